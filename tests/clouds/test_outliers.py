# SPDX-License-Identifier: Apache-2.0
"""Outliers are removed from images and flat clouds; surfaces, thin ones as well, stay."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from doorstate.clouds.outliers import BLOB_PX, outlier_mask, remove_outliers
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.noise.ghosts import Ghosts, add_ghosts
from doorstate.simulation.presets import PRESETS
from doorstate.types import Part, Points

HEIGHT, WIDTH, FOCAL_PX = 480, 640, 554.4


def from_depth(depth_m: NDArray[np.float32]) -> Points:
    """Return points (H, W, 3) of a depth image, with NaN as in the image."""
    height, width = depth_m.shape
    focal_px = FOCAL_PX * height / HEIGHT
    left, up = np.meshgrid(
        (width / 2 - np.arange(width)) / focal_px, (height / 2 - np.arange(height)) / focal_px
    )
    return (depth_m[..., None] * np.stack((np.ones_like(left), left, up), axis=-1)).astype(np.float32)


def room(height: int = HEIGHT, width: int = WIDTH, camera_m: float = 1.0) -> NDArray[np.float32]:
    """Return the depth of a wall 3.5 m ahead with a floor before it."""
    below = (np.arange(height) - height / 2) / (FOCAL_PX * height / HEIGHT)
    with np.errstate(divide="ignore"):
        to_floor_m = np.where(below > 0, camera_m / below, np.inf)
    return np.broadcast_to(np.minimum(3.5, to_floor_m)[:, None], (height, width)).astype(np.float32)


@pytest.mark.parametrize("towards", ["front", "behind"])
@pytest.mark.parametrize("side_px", [1, 2, 3, BLOB_PX])
@pytest.mark.parametrize("share", [0.001, 0.01])
def test_blobs_are_removed_and_surfaces_stay(share: float, side_px: int, towards: str) -> None:
    clean = room()
    depth_m = add_ghosts(
        clean, Ghosts(share=share, side_px=side_px, towards=towards), np.random.default_rng(0)
    )
    ghosts = depth_m != clean
    cloud = from_depth(depth_m)
    organized = outlier_mask(cloud)
    assert (organized & ghosts).sum() >= 0.98 * ghosts.sum()
    assert (organized & ~ghosts).sum() <= 1e-4 * ghosts.size
    flat = outlier_mask(cloud.reshape(-1, 3)).reshape(HEIGHT, WIDTH)
    assert (flat & ghosts).sum() >= 0.85 * ghosts.sum()
    assert not (flat & ~ghosts).any()


@pytest.mark.parametrize("camera_m", [0.3, 1.0])
def test_nothing_of_a_room_is_removed(camera_m: float) -> None:
    for height, width in ((HEIGHT, WIDTH), (240, 320), (60, 80), (720, 1280)):
        cloud = from_depth(room(height, width, camera_m))
        assert outlier_mask(cloud).mean() < 1e-3
        assert outlier_mask(cloud.reshape(-1, 3)).mean() < 1e-3


def test_thin_things_stay() -> None:
    depth_m = room()
    depth_m[100:400, 200:202] = 2.0  # a pole, 7 mm wide
    depth_m[50:52, 300:600] = 1.5  # a bar
    depth_m[300:400, 400:405] = 2.5  # an edge of a leaf
    thin = depth_m != room()
    cloud = from_depth(depth_m)
    assert not outlier_mask(cloud).any()
    assert (outlier_mask(cloud.reshape(-1, 3)).reshape(thin.shape) & thin).sum() <= 0.1 * thin.sum()


@pytest.mark.parametrize("sensor", ["none", "xtion", "d435"])
def test_parts_of_simulated_doors_stay(sensor: str) -> None:
    _, frames = simulate_rows(PRESETS["varied"], 123, 4, sensor)
    for frame in frames:
        part = frame.cut.part
        measured = part != Part.NONE
        for outliers in (
            outlier_mask(frame.points),
            outlier_mask(frame.points.reshape(-1, 3)).reshape(part.shape),
        ):
            # A jamb may show a single column of pixels behind the leaf.
            for kind, share in (
                (Part.LEAF, 0.003),
                (Part.WALL, 0.003),
                (Part.FLOOR, 0.003),
                (Part.FRAME, 0.04),
            ):
                count = (measured & (part == kind)).sum()
                assert (outliers & (part == kind)).sum() <= share * count


@pytest.mark.parametrize("lost", [0.3, 0.5, 0.75, 0.9])
def test_surfaces_with_scattered_gaps_stay(lost: float) -> None:
    depth_m = np.where(np.random.default_rng(0).random((HEIGHT, WIDTH)) < lost, np.nan, room())
    measured = ~np.isnan(depth_m)
    assert outlier_mask(from_depth(depth_m)).sum() < 0.03 * measured.sum()
    rows_and_columns = np.full_like(depth_m, np.nan)
    rows_and_columns[::4, ::4] = room()[::4, ::4]
    assert outlier_mask(from_depth(rows_and_columns)).sum() < 0.01 * HEIGHT * WIDTH / 16


def test_removed_points_are_nan_and_counted() -> None:
    depth_m = room()
    depth_m[200:202, 300:302] = 1.0
    depth_m[0] = np.nan
    cloud = from_depth(depth_m)
    clean = remove_outliers(cloud)
    assert clean.outlier_share == 4 / np.isfinite(depth_m).sum()
    assert np.isnan(clean.points[200:202, 300:302]).all()
    changed = np.isnan(clean.points).any(axis=-1) != np.isnan(depth_m)
    assert changed.sum() == 4
    assert cloud[200, 300, 0] == 1.0  # the raw cloud is left as it is
    untouched = from_depth(room())
    assert remove_outliers(untouched).points is untouched


def test_units_and_quarter_turns_make_no_difference() -> None:
    depth_m = room()
    depth_m[100:103, 100:103] = 2.0
    cloud = from_depth(depth_m)
    expected = outlier_mask(cloud)
    assert expected.sum() == 9
    np.testing.assert_array_equal(outlier_mask(cloud * np.float32(1000)), expected)
    np.testing.assert_array_equal(outlier_mask(np.rot90(cloud)), np.rot90(expected))
    np.testing.assert_array_equal(outlier_mask((cloud * 1000).astype(np.int32)), expected)


def test_prepared_clouds_hold_no_outliers() -> None:
    rng = np.random.default_rng(3)
    depth_m = add_ghosts(room(), Ghosts(share=0.01, side_px=2), rng)
    ghosts = np.flatnonzero(depth_m != room())
    for cloud in (from_depth(depth_m), from_depth(depth_m).reshape(-1, 3)):
        raw, cleaned = (
            np.isin(
                prepare_cloud(cloud, CloudSpec(num_points=512, thin=True, remove_outliers=removed)).indices,
                ghosts,
            )
            for removed in (False, True)
        )
        assert raw.mean() > 0.1
        assert cleaned.mean() < 0.05


def test_a_scan_around_the_sensor_keeps_its_surfaces() -> None:
    azimuth, elevation = np.meshgrid(np.linspace(-np.pi, np.pi, 1800), np.radians(np.linspace(-15, 15, 16)))
    rays = np.stack(
        (np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)), axis=-1
    )
    cloud = (rays * 2.5 / np.abs(rays[..., :2]).max(axis=-1, keepdims=True)).astype(np.float32)  # four walls
    assert not outlier_mask(cloud.reshape(-1, 3)).any()
    assert outlier_mask(cloud).mean() < 1e-3
    cloud[8, ::300] *= np.float32(0.4)
    assert outlier_mask(cloud.reshape(-1, 3)).sum() == 6
    assert outlier_mask(cloud).sum() == 6


SPECIAL = np.array([0, np.nan, np.inf, -np.inf, 3.4e38, -3.4e38, 1e-30, 1e7, 1], np.float32)


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0, 1), spread=st.floats(1e-6, 30))
@settings(max_examples=20)
def test_any_values_are_taken(seed: int, share: float, spread: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.exp(rng.normal(0, spread, (600, 3))).clip(0, 1e38).astype(np.float32)
    special = rng.random(points.shape) < share
    points[special] = rng.choice(SPECIAL, special.sum())
    for cloud in (points, points.reshape(20, 30, 3)):
        mask = outlier_mask(cloud)
        assert mask.shape == cloud.shape[:-1]
        assert not mask[~np.isfinite(cloud).all(axis=-1)].any()
