# SPDX-License-Identifier: Apache-2.0
"""Crops of doorways: labels of candidates, doors in their frames, and data sets of crops end to end."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import read_csv
from doorstate.clouds.augmentation import Augmentation
from doorstate.clouds.normalization import NORMALIZATIONS
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset import crops as crops_module
from doorstate.dataset.crops import (
    ADDED,
    Crops,
    candidate_columns,
    doorway_of,
    frame_row,
    hit_door,
)
from doorstate.dataset.join import join_datasets
from doorstate.dataset.loader import CloudLoader
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.dataset.simulated import simulate_prepared
from doorstate.dataset.splits import draw_splits
from doorstate.dataset.store import CLOUDS_FILE, MANIFEST_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.doorways.crop import DEFAULT_CROP
from doorstate.doorways.doorway import Doorway
from doorstate.errors import ConfigError
from doorstate.networks.heads import HEADS, head_targets
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.frames import depth_sha256, replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.manifest import flatten
from doorstate.simulation.presets import PRESETS, Preset, PresetName
from doorstate.simulation.row import Row
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.truth import true_doors
from doorstate.simulation.writer import simulate_dataset
from doorstate.types import Part, Points
from tests.error_fields import about

NUM_POINTS = 160
SPEC = CloudSpec(num_points=NUM_POINTS, thin=True)
ALL, BEST = Crops(add_missed=True), Crops(kept="best")
Found = list[Doorway]


@pytest.fixture(scope="module")
def row() -> Row:
    """A semi-open door."""
    return simulate_rows(PRESETS["ogurob"], 3, 700)[0][1]


def at_door(row: Row, along_m: float = 0.0, turn_deg: float = 0.0) -> Doorway:
    door = true_doors(row)[0]
    doorway = Doorway(door.x_m, door.y_m, door.yaw_deg, door.width_m, door.floor_z_m, score=0.7)
    x_m, y_m, _ = doorway.to_sensor(np.array([along_m, 0, 0], np.float32)).tolist()
    return replace(doorway, x_m=x_m, y_m=y_m, yaw_deg=door.yaw_deg + turn_deg)


def fixed_places(cloud: Points, floor_z_m: float | None = None) -> Found:
    """Stand for the finder: two places ahead, and none in a third of the scenes."""
    if floor_z_m is None or round(1000 * floor_z_m) % 3 == 1:
        return []
    return [Doorway(2.2, 0.0, 95.0, 0.9, floor_z_m, 0.9), Doorway(2.4, 0.8, 85.0, 0.9, floor_z_m, 0.4)]


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[..., Found]], None]:
    return lambda finder: monkeypatch.setattr(crops_module, "find_doorways", finder)


@pytest.mark.parametrize(
    ("along_m", "turn_deg", "is_hit"),
    [(0.34, 0, True), (-0.36, 0, False), (0.1, 19, True), (0, -21, False), (0, 360, True), (0, 180, False)],
)
def test_a_candidate_near_a_door_hits_it(row: Row, along_m: float, turn_deg: float, is_hit: bool) -> None:
    assert (hit_door(row, at_door(row, along_m, turn_deg)) is not None) == is_hit
    (_, line), *_ = candidate_columns(row, [at_door(row, along_m, turn_deg)], Crops())
    assert line["state"] == ("semi_open" if is_hit else "no_door")


def test_a_crop_of_a_door_of_unknown_state_shows_a_door(row: Row) -> None:
    unknown = row.model_copy(
        update={"state": "unknown", "hinge": "", "opening_angle_deg": None, "door_kind": "folding"}
    )
    lines = candidate_columns(unknown, [at_door(row), at_door(row, 2.0)], Crops())
    assert [line["state"] for _, line in lines] == ["unknown", "no_door"]
    door = lines[0][1]
    assert (door["hinge"], door["opening_angle_deg"]) == ("", "")
    assert float(door["door_x_m"]) == pytest.approx(0.0, abs=1e-4)
    targets = head_targets([door], NORMALIZATIONS["doorway"].placement(np.zeros((1, 4, 3), np.float32)))
    assert targets["door"][0, 0] == 1
    assert np.isnan(targets["angle"]).all()


def test_the_door_of_a_crop_is_in_its_frame(row: Row) -> None:
    ((_, line),) = candidate_columns(row, [at_door(row, 0.1, 5.0)], Crops())
    assert (line["sample_id"], line["frame_id"], line["candidate"]) == (
        f"{row.sample_id}-c0",
        row.sample_id,
        "0",
    )
    assert float(line["door_yaw_deg"]) == pytest.approx(-5)
    assert float(line["door_x_m"]) == pytest.approx(-0.1 * np.cos(np.radians(5)), abs=1e-4)
    assert float(line["door_y_m"]) == pytest.approx(0.1 * np.sin(np.radians(5)), abs=1e-4)
    assert float(line["door_z_m"]) == pytest.approx(0, abs=1e-5)
    assert (line["hinge"], line["opening_angle_deg"]) == (row.hinge, str(row.opening_angle_deg))
    normalization = NORMALIZATIONS["doorway"]
    placement = normalization.placement(np.zeros((1, 5, 3), np.float32))
    targets = head_targets([{**flatten(row), **line}], placement)
    np.testing.assert_allclose(targets["frame"][0, :2] * 1.5, [-0.0996, 0.0087], atol=1e-3)
    assert np.degrees(targets["frame"][0, 2]) == pytest.approx(85)
    assert targets["widths"][0, 0] * 1.5 == pytest.approx(row.opening_width_m)


def test_a_crop_without_a_door_has_no_targets_but_the_row_of_its_frame(row: Row) -> None:
    ((doorway, columns),) = candidate_columns(row, [at_door(row, 2.0)], Crops())
    line = {**flatten(row), **columns}
    placement = NORMALIZATIONS["doorway"].placement(np.zeros((1, 5, 3), np.float32))
    targets = head_targets([line], placement)
    assert targets.pop("door").tolist() == [[0]]
    assert len(targets) == len(HEADS) - 1
    assert all(np.isnan(values).all() for values in targets.values())
    assert line["ambiguous"] == "False"
    assert frame_row(line) == row
    assert frame_row(flatten(row)) == row
    assert depth_sha256(replay(frame_row(line))) == row.depth_sha256
    assert doorway_of(line) == doorway


def test_doors_that_no_candidate_hits_are_added_where_they_can_be_seen(row: Row) -> None:
    for candidates in ([], [at_door(row, 1.0)]):
        *_, (doorway, line) = candidate_columns(row, candidates, ALL)
        assert (line["state"], line["candidate"]) == ("semi_open", ADDED)
        assert line["sample_id"] == f"{row.sample_id}-a0"
        door = true_doors(row)[0]
        assert 0 < np.hypot(doorway.x_m - door.x_m, doorway.y_m - door.y_m) < 0.2
        assert 0 < abs(doorway.yaw_deg - door.yaw_deg) <= 6
        assert candidate_columns(row, candidates, ALL)[-1][0] == doorway, "the same errors every time"
        assert len(candidate_columns(row, candidates, Crops())) == len(candidates)
    assert len(candidate_columns(row, [at_door(row)], ALL)) == 1
    hidden = row.model_copy(update={f"visible_{part}_px": 100 for part in ("leaf", "frame", "opening")})
    assert candidate_columns(hidden, [], ALL) == []


def test_the_best_crop_has_the_state_of_its_frame_whatever_it_shows(row: Row) -> None:
    ((doorway, line),) = candidate_columns(row, [at_door(row, 2.0), at_door(row)], BEST)
    assert doorway == at_door(row, 2.0)
    assert (line["sample_id"], line["state"]) == (row.sample_id, "semi_open")
    assert float(line["door_x_m"]) == pytest.approx(-2, abs=1e-4)
    assert candidate_columns(row, [], BEST) == []


def settings_of(name: PresetName, scenes: int) -> SimulationSettings:
    preset = Preset(name=name, camera=DepthCamera(width=160, height=120))
    return SimulationSettings(preset=preset, seed=5, poses=scenes)


@pytest.fixture(scope="module")
def simulations(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulations")
    for name in ("varied", "no-door"):
        simulate_dataset(folder / name, settings_of(name, 10), 1)  # type: ignore[arg-type]
    return folder


@pytest.fixture(scope="module")
def prepared_crops(simulations: Path, tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crops_module, "find_doorways", fixed_places)
        folder = tmp_path_factory.mktemp("crops") / "varied"
        return prepare_dataset(Preparation(simulations / "varied", SPEC, crops=ALL), folder, 1).dataset


def test_frames_give_one_crop_for_each_candidate(prepared_crops: PreparedDataset, simulations: Path) -> None:
    rows, frames = prepared_crops.rows, read_csv(simulations / "varied" / MANIFEST_FILE)
    assert (prepared_crops.description.input, prepared_crops.description.crops) == ("doorway", ALL)
    assert prepared_crops.clouds.shape == (len(rows), NUM_POINTS, 3)
    assert DEFAULT_CROP.contains(np.asarray(prepared_crops.clouds)).all()
    assert {row["frame_id"] for row in rows} == {row["sample_id"] for row in frames}
    assert {row["state"] for row in rows} == {"closed", "semi_open", "open", "no_door"}
    assert {row["candidate"] for row in rows} == {"0", "1", ADDED}
    doors = [row for row in rows if row["state"] != "no_door"]
    assert all(row["state"] == row["frame.state"] for row in doors)
    assert all(abs(float(row["door_x_m"])) <= 0.36 for row in doors)


def test_clouds_and_parts_are_rendered_again_from_their_lines(
    prepared_crops: PreparedDataset, tmp_path: Path
) -> None:
    shutil.copy(prepared_crops.folder / MANIFEST_FILE, tmp_path)
    prepared_crops.description.model_copy(update={"clouds": "replayed"}).save(tmp_path)
    lines = open_dataset(tmp_path)
    for index in (0, 1, len(lines) - 1):
        np.testing.assert_array_equal(lines.cloud(index), prepared_crops.cloud(index))
        np.testing.assert_array_equal(lines.parts(index, 99), prepared_crops.parts(index, 99))
    parts = prepared_crops.parts(0)
    assert parts is not None
    assert (parts != Part.NONE).all()
    raw = lines.raw_cloud(0)
    inside = ~np.isnan(raw[..., 0])
    assert 0 < inside.mean() < 1
    assert DEFAULT_CROP.contains(doorway_of(lines.rows[0]).to_doorway(raw[inside])).all()
    assert lines.image(0) is not None


def test_one_pass_writes_the_same_crops(
    prepared_crops: PreparedDataset, tmp_path: Path, found: Callable[[Callable[..., Found]], None]
) -> None:
    found(fixed_places)
    preparation = Preparation(tmp_path / "varied", SPEC, crops=ALL)
    simulate_prepared(settings_of("varied", 10), preparation, tmp_path / "out", 1)
    for name in (CLOUDS_FILE, PARTS_FILE, MANIFEST_FILE):
        assert (tmp_path / "out" / name).read_bytes() == (prepared_crops.folder / name).read_bytes()
    with pytest.raises(ConfigError, check=about(tmp_path / "out")):
        prepare_dataset(preparation._replace(crops=Crops()), tmp_path / "out", 1)


def test_frames_without_a_candidate_are_rejected_by_name(
    simulations: Path, tmp_path: Path, found: Callable[[Callable[..., Found]], None]
) -> None:
    found(fixed_places)
    summary = prepare_dataset(Preparation(simulations / "no-door", SPEC, crops=BEST), tmp_path / "out", 1)
    assert len(summary.rejected) > 0
    assert summary.dataset.description.left_out == {"no_door": len(summary.rejected)}
    names = [row["sample_id"] for row in summary.rejected] + summary.dataset.sample_ids
    assert sorted(names) == sorted(row["sample_id"] for row in read_csv(simulations / "no-door/manifest.csv"))


def test_crops_are_loaded_about_the_centre_of_their_doorway(prepared_crops: PreparedDataset) -> None:
    loader = CloudLoader(prepared_crops, prepared_crops.sample_ids[:6], 100, heads=("door", "frame"))
    (batch,) = loader.in_order(6)
    expected = (prepared_crops.clouds[:6, :100] - np.float32([0, 0, 1.05])) / np.float32(1.5)
    np.testing.assert_array_equal(batch.points, expected)
    assert np.abs(expected).max() <= 1.06


def test_an_epoch_has_the_share_of_crops_without_a_door_that_is_asked_for(
    prepared_crops: PreparedDataset,
) -> None:
    loader = CloudLoader(prepared_crops, prepared_crops.sample_ids, 100, heads=("door",))
    for share in (0.0, 0.25, 0.5):
        batches = list(loader.shuffled(8, Augmentation(), (1,), limit=32, no_door_share=share))
        assert [len(batch.labels) for batch in batches] == [8] * 4
        assert sum(int((batch.labels < 0).sum()) for batch in batches) == round(32 * share)


def test_added_doors_are_only_trained_on(prepared_crops: PreparedDataset) -> None:
    rows = [
        row | {name: f"{number}{row[name]}" for name in ("sample_id", "scene_id")}
        for number in range(4)
        for row in prepared_crops.rows
    ]
    added = {row["sample_id"] for row in rows if row["candidate"] == ADDED}
    assert added
    for roles in draw_splits(rows, "by-scene", 0):
        assert {roles[sample] for sample in added} <= {"train", "unused"}
        by_scene: dict[str, set[str]] = {}
        for row in rows:
            by_scene.setdefault(row["scene_id"], set()).add(roles[row["sample_id"]])
        assert all(len(found - {"unused"}) <= 1 for found in by_scene.values())


def test_crops_and_whole_clouds_are_not_joined(
    prepared_crops: PreparedDataset, simulations: Path, tmp_path: Path
) -> None:
    prepare_dataset(Preparation(simulations / "no-door", SPEC), tmp_path / "whole", 1)
    with pytest.raises(ConfigError, check=about(tmp_path / "whole")):
        join_datasets([prepared_crops.folder, tmp_path / "whole"], tmp_path / "both")
    shutil.copytree(prepared_crops.folder, tmp_path / "again")
    manifest = tmp_path / "again" / MANIFEST_FILE
    manifest.write_text(manifest.read_text().replace("varied-5-", "varied-6-"))
    joined = join_datasets([prepared_crops.folder, tmp_path / "again"], tmp_path / "both")
    assert joined.description.crops == ALL
    assert joined.has_parts


def test_recorded_clouds_keep_their_label_at_the_best_candidate(
    simulated_folder: Path, tmp_path: Path, found: Callable[[Callable[..., Found]], None]
) -> None:
    found(fixed_places)
    recorded = simulated_folder / "pcd"
    with pytest.raises(ConfigError) as refused:
        prepare_dataset(Preparation(recorded, SPEC, crops=Crops()), tmp_path / "all", 1)
    assert refused.value.field == "crops"
    dataset = prepare_dataset(Preparation(recorded, SPEC, crops=BEST), tmp_path / "best", 1).dataset
    assert {row["state"] for row in dataset.rows} == {"closed", "semi_open", "open"}
    row = dataset.rows[0]
    assert (row["frame_id"], row["candidate"]) == (row["sample_id"], "0")
    np.testing.assert_allclose(dataset.raw_cloud(0), doorway_of(row).to_sensor(dataset.cloud(0)))
