# SPDX-License-Identifier: Apache-2.0
"""Corrupted crops: things stay off openings, parts stay with their points, and only training sees any of it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from doorstate._files import write_csv
from doorstate.clouds.augmentation import Augmentation
from doorstate.clouds.corruption import Corruption, draw_corruption
from doorstate.dataset.corruptor import CLEARANCE_M, MOST_PASTED, Corruptor, Openings, beside_opening
from doorstate.dataset.crops import Crops
from doorstate.dataset.description import DatasetDescription
from doorstate.dataset.loader import CloudLoader
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.errors import ConfigError
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.types import NO_DOOR, STATES, Part

SCALE_M = 1.5
DOORS, OTHERS, STORED, USED = 9, 6, 160, 100
NOTHING = Augmentation()
ALL = Corruption(cut_outs=2, holes=0.3, thinning=0.5, mix=0.6)


@pytest.fixture(scope="module")
def crops(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """Random crops in metres: those with a door have no part `other`, those without have things everywhere."""
    folder = tmp_path_factory.mktemp("crops")
    rng = np.random.default_rng(0)
    size = DOORS + OTHERS
    clouds = rng.uniform((-1.5, -1.5, 0), (1.5, 1.5, 2.1), (size, STORED, 3)).astype(np.float32)
    parts = rng.choice([Part.WALL, Part.LEAF, Part.FLOOR], (size, STORED)).astype(np.uint8)
    parts[DOORS:] = np.where(rng.random((OTHERS, STORED)) < 0.7, Part.OTHER, Part.WALL)
    np.save(folder / CLOUDS_FILE, clouds)
    np.save(folder / PARTS_FILE, parts)
    door = {"door_x_m": "0.05", "door_y_m": "0.02", "door_yaw_deg": "0", "opening_width_m": "0.9"}
    rows = [{"sample_id": f"d{number}", "state": STATES[number % 3], **door} for number in range(DOORS)]
    rows += [
        {"sample_id": f"n{number}", "state": NO_DOOR, **dict.fromkeys(door, "")} for number in range(OTHERS)
    ]
    write_csv(folder / MANIFEST_FILE, rows)
    DatasetDescription(
        kind="simulated",
        source="by hand",
        num_points=STORED,
        samples=size,
        crops=Crops(),
        doorstate_version="0",
    ).save(folder)
    return open_dataset(folder)


def loader(
    crops: PreparedDataset, corruption: Corruption | None, points: int = USED, **options: object
) -> CloudLoader:
    heads = ("door", "frame", "widths", "parts")
    return CloudLoader(crops, crops.sample_ids, points, heads=heads, corruption=corruption, **options)  # type: ignore[arg-type]


def corruptor(crops: PreparedDataset, corruption: Corruption) -> Corruptor:
    has_door = crops.labels < len(STATES)
    openings = Openings(
        *(np.where(has_door, value / SCALE_M, 0).astype(np.float32) for value in (0.05, 0.02, 0.9))
    )
    parts = crops.parts_of(np.arange(len(crops)), STORED)
    return Corruptor(corruption, crops.normalization(crops.clouds), parts, openings, has_door, SCALE_M)


def test_every_point_is_one_of_its_crop_or_a_thing_with_its_part(crops: PreparedDataset) -> None:
    rows, draw = np.arange(len(crops)), draw_corruption(ALL, np.random.default_rng(2), len(crops), SCALE_M)
    points, parts = corruptor(crops, ALL)(rows, draw, USED)
    assert parts is not None
    assert (points.shape, points.dtype, parts.shape) == (
        (len(crops), USED, 3),
        np.float32,
        (len(crops), USED),
    )
    everything = crops.normalization(crops.clouds)
    stored = crops.parts_of(rows, STORED)
    places = {
        tuple(point * [side, 1, 1]): (crop, part)
        for side in (-1, 1)  # a donor may be mirrored
        for crop in rows
        for point, part in zip(everything[crop], stored[crop], strict=True)
    }
    pasted = np.zeros(len(crops), int)
    for row in rows:
        for point, part in zip(points[row], parts[row], strict=True):
            origin, true_part = places[tuple(point)]
            assert part == true_part
            if origin != row:
                pasted[row] += 1
                assert true_part == Part.OTHER
                assert origin >= DOORS
                x_m, y_m = point[:2] * SCALE_M - (0.05, 0.02) if row < DOORS else point[:2] * SCALE_M
                assert draw.sides[row] * x_m >= 0
                width_m = 0.9 if row < DOORS else 0.0
                assert y_m >= CLEARANCE_M - 1e-6
                assert abs(x_m) >= width_m / 2 + CLEARANCE_M - 1e-6 or y_m >= width_m + CLEARANCE_M - 1e-6
    assert not pasted[np.isnan(draw.donors)].any()
    assert (pasted[~np.isnan(draw.donors)] > 0).mean() > 0.5  # some would be mixed with themselves
    assert pasted.max() <= MOST_PASTED * USED


def test_both_crops_of_a_mixture_keep_their_order(crops: PreparedDataset) -> None:
    mix = Corruption(mix=1.0)
    rows, draw = np.arange(DOORS), draw_corruption(mix, np.random.default_rng(0), DOORS, SCALE_M)
    points, _ = corruptor(crops, mix)(rows, draw, USED)
    everything = crops.normalization(crops.clouds)
    for row in rows:
        ranks = [
            np.flatnonzero((np.abs(everything) == np.abs(point)).all(axis=2))[0] % STORED
            for point in points[row]
        ]
        assert (np.diff(ranks) >= 0).all()


@pytest.mark.parametrize(
    ("point_m", "allowed"),
    [
        ((0.7, 0.2), True),  # beside the opening
        ((0.7, 0.05), False),  # in the wall
        ((0.3, 0.5), False),  # in the sweep of the leaf
        ((0.3, 1.1), True),  # before it
        ((-0.3, 1.1), False),  # on the other side
        ((0.7, -0.5), False),  # behind the wall
    ],
)
def test_things_stand_on_one_side_and_off_the_sweep(point_m: tuple[float, float], allowed: bool) -> None:
    opening = Openings(*np.float32([[0.0], [0.0], [0.9 / SCALE_M]]))
    point = np.float32([[[*point_m, 0]]]) / np.float32(SCALE_M)
    assert beside_opening(point, opening, np.float32([1]), SCALE_M).item() is allowed
    mirrored = point * np.float32([-1, 1, 1])
    assert beside_opening(mirrored, opening, np.float32([-1]), SCALE_M).item() is allowed


def test_an_opening_of_unknown_place_gets_nothing() -> None:
    unknown = Openings(*np.float32([[np.nan]] * 3))
    points = np.random.default_rng(0).uniform(-1, 1, (1, 50, 3)).astype(np.float32)
    assert not beside_opening(points, unknown, np.float32([1]), SCALE_M).any()


def test_only_shuffled_crops_are_corrupted(crops: PreparedDataset) -> None:
    plain, corrupted = loader(crops, None), loader(crops, ALL)
    for one, other in zip(plain.in_order(4), corrupted.in_order(4), strict=True):
        assert torch.equal(one.points, other.points)
        assert torch.equal(one.targets["parts"], other.targets["parts"])
    first, again = (list(corrupted.shuffled(5, NOTHING, (7,))) for _ in range(2))
    later = list(corrupted.shuffled(5, NOTHING, (7,), skip=1))
    for one, other in zip(first[1:] + first, later + again, strict=True):
        assert torch.equal(one.points, other.points)
    assert first[0].points.shape == (5, USED, 3)
    (everything,) = plain.in_order(len(plain))
    assert not any(
        torch.equal(cloud, stored)
        for batch in first
        for cloud in batch.points
        for stored in everything.points
    )


def test_labels_and_targets_are_those_of_the_crop(crops: PreparedDataset) -> None:
    plain, corrupted = (
        list(loader(crops, corruption).shuffled(15, NOTHING, (3,))) for corruption in (None, ALL)
    )
    assert torch.equal(plain[0].labels, corrupted[0].labels)
    for name in ("door", "frame", "widths"):
        torch.testing.assert_close(
            plain[0].targets[name], corrupted[0].targets[name], rtol=0, atol=0, equal_nan=True
        )


def test_a_corruption_that_changes_nothing_is_none(crops: PreparedDataset) -> None:
    augmentation = Augmentation(yaw_deg=10, jitter=0.01)
    for one, other in zip(
        *(loader(crops, corruption).shuffled(5, augmentation, (1,)) for corruption in (None, Corruption())),
        strict=True,
    ):
        assert torch.equal(one.points, other.points)


def test_stored_points_replace_lost_ones_before_any_is_repeated(crops: PreparedDataset) -> None:
    holes = Corruption(holes=0.3)
    for points, repeats in ((USED, False), (STORED, True)):
        (batch,) = loader(crops, holes, points).shuffled(15, NOTHING, (0,))
        distinct = [len(cloud.unique(dim=0)) for cloud in batch.points]
        assert (min(distinct) < points) == repeats


def test_what_cannot_be_corrupted_is_refused(crops: PreparedDataset, scene_dataset: PreparedDataset) -> None:
    with pytest.raises(ConfigError) as whole:
        CloudLoader(scene_dataset, scene_dataset.sample_ids[:3], 128, corruption=Corruption(holes=0.1))
    assert whole.value.field == "corruption"
    with pytest.raises(ConfigError) as alone:
        CloudLoader(crops, crops.sample_ids[:DOORS], USED, corruption=Corruption(mix=0.5))
    assert alone.value.field == "corruption"
