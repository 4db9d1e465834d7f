# SPDX-License-Identifier: Apache-2.0
"""Crops: points of the box alone, in the doorway's frame, however the cloud is stored."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.clouds.samplers import NUMPY
from doorstate.doorways.crop import CropSpec, crop_cloud
from doorstate.doorways.doorway import Doorway
from doorstate.errors import TooFewPointsError
from doorstate.simulation.frames import Frame
from doorstate.simulation.presets import PRESETS, draw_rows

SPEC = CropSpec(num_points=256)


@pytest.fixture(scope="module")
def doorway() -> Doorway:
    """The door of the frames."""
    row = draw_rows(PRESETS["ogurob"], 3, 700)[0]
    assert row.door_x_m is not None
    assert row.door_y_m is not None
    assert row.door_yaw_deg is not None
    return Doorway(row.door_x_m, row.door_y_m, row.door_yaw_deg, 0.9, -row.camera_height_m)


@pytest.mark.parametrize("is_flat", [False, True])
def test_points_are_those_of_the_box_in_the_frame_of_the_doorway(
    frames: list[Frame], doorway: Doorway, is_flat: bool
) -> None:
    cloud = frames[2].points.reshape(-1, 3) if is_flat else frames[2].points
    points, rows = crop_cloud(cloud, doorway, SPEC)
    assert (points.shape, points.dtype) == ((256, 3), np.float32)
    assert SPEC.contains(points).all()
    np.testing.assert_allclose(doorway.to_sensor(points), cloud.reshape(-1, 3)[rows], atol=1e-5)
    assert len(np.unique(points, axis=0)) == 256
    fewer = crop_cloud(cloud, doorway, CropSpec(num_points=256, top_m=1.0)).points
    assert fewer[:, 2].max() <= 1.0 < points[:, 2].max()


def test_the_first_points_are_a_farthest_point_sample(frames: list[Frame], doorway: Doorway) -> None:
    points = crop_cloud(frames[0].points, doorway, SPEC).points.astype(np.float64)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    nearest_m = [apart[number, :number].min() for number in range(2, 256)]
    assert (np.diff(nearest_m) <= 1e-6).all()


def test_all_samplers_give_the_same_crop(frames: list[Frame], doorway: Doorway) -> None:
    crop, of_numpy = (crop_cloud(frames[1].points, doorway, SPEC, sampler) for sampler in (None, NUMPY))
    np.testing.assert_array_equal(crop.indices, of_numpy.indices)


def test_missing_pixels_are_not_cropped(frames: list[Frame], doorway: Doorway) -> None:
    cloud = frames[0].points.copy()
    cloud[::2] = np.nan
    cloud[1::4] = 0
    cloud[:, 3::5] = np.inf
    points, rows = crop_cloud(cloud, doorway, SPEC)
    assert len(points) == 256
    assert np.isfinite(points).all()
    assert np.abs(cloud.reshape(-1, 3)[rows]).sum(axis=1).min() > 0
    with pytest.raises(TooFewPointsError):  # around the camera are missing pixels only
        crop_cloud(cloud, Doorway(-1.3, 0.0, 90.0, 0.9, -0.5), SPEC)


def test_a_small_hole_in_a_wall_is_filled(frames: list[Frame], doorway: Doorway) -> None:
    spec = CropSpec(num_points=1024)
    cloud = frames[0].points.copy()
    x, _, z = np.moveaxis(doorway.to_doorway(cloud), -1, 0)
    hole = (x > -0.12) & (x < 0.07) & (z > 1.18) & (z < 1.42)
    cloud[hole] = np.nan
    points, rows = crop_cloud(cloud, doorway, spec)
    x, _, z = points.T
    filled = (x > -0.1) & (x < 0.05) & (z > 1.2) & (z < 1.4)
    assert filled.any()
    assert np.isfinite(cloud.reshape(-1, 3)[rows]).all()
    gaps_m = np.linalg.norm(doorway.to_sensor(points) - cloud.reshape(-1, 3)[rows], axis=1)
    assert gaps_m[filled].max() < 0.2
    assert gaps_m[~filled].max() < 0.15


def test_a_place_without_points_is_refused(frames: list[Frame]) -> None:
    for cloud in (frames[0].points, frames[0].points.reshape(-1, 3)):
        with pytest.raises(TooFewPointsError):
            crop_cloud(cloud, Doorway(-8.0, 0.0, 90.0, 0.9, -0.5), SPEC)
    few = np.random.default_rng(0).uniform(-0.5, 0.5, (127, 3)).astype(np.float32) + np.float32([2, 0, 0])
    with pytest.raises(TooFewPointsError):
        crop_cloud(few, Doorway(2.0, 0.0, 90.0, 0.9, -1.0), SPEC)


@given(x_m=st.floats(-5, 5), y_m=st.floats(-5, 5), yaw_deg=st.floats(-360, 360), floor_z_m=st.floats(-2, 0))
@settings(max_examples=50)
def test_the_frame_of_a_doorway_turns_and_moves_points(
    x_m: float, y_m: float, yaw_deg: float, floor_z_m: float
) -> None:
    doorway = Doorway(x_m, y_m, yaw_deg, 0.9, floor_z_m)
    left = [x_m + math.cos(math.radians(yaw_deg)), y_m + math.sin(math.radians(yaw_deg)), floor_z_m]
    points = np.array([[x_m, y_m, floor_z_m], left, [x_m, y_m, floor_z_m + 1]], np.float32)
    np.testing.assert_allclose(doorway.to_doorway(points), [[0, 0, 0], [1, 0, 0], [0, 0, 1]], atol=1e-5)
