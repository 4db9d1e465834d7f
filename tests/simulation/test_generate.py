# SPDX-License-Identifier: Apache-2.0
"""Columns that depend on the image: visible pixels, identical images, sensors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.errors import ConfigError
from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.draw.half_ring import half_ring
from doorstate.simulation.frames import replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS, Preset, PresetName
from doorstate.simulation.row import Row
from doorstate.types import Part
from tests.simulation import naive_caster

AHEAD = half_ring().index((0, 20))


def small(name: PresetName, width: int = 80, height: int = 60) -> Preset:
    return Preset(name=name, camera=DepthCamera(width=width, height=height))


def simulated(sensor: str) -> list[Row]:
    rows = simulate_rows(small("ogurob"), 0, 700, sensor)[0]
    return rows + simulate_rows(small("cluttered"), 0, 1, sensor)[0]


@pytest.mark.parametrize(
    ("name", "index"), [("ogurob", 10), ("ogurob", 900), ("ogurob-away", 24), ("ogurob-fixed", 400)]
)
def test_visible_pixels_equal_a_count_over_rays(name: PresetName, index: int) -> None:
    for row in simulate_rows(small(name, 40, 30), 0, index)[0]:
        pose, camera = row.camera_pose(), row.camera.intrinsics()
        depth, part = naive_caster.cast(row.boxes(), pose, camera)
        part[(depth <= 0.4) | (depth >= 5.0)] = Part.NONE
        into_opening = 0
        for v in range(camera.height):
            for u in range(camera.width):
                ray = naive_caster.pixel_ray(v, u, pose, camera)
                reach = -pose.y_m / ray[1]
                x, z = pose.x_m + reach * ray[0], pose.z_m + reach * ray[2]
                meets = reach > 0 and abs(x) < 0.45 and 0 < z < 2.1
                into_opening += meets and depth[v, u] >= reach - 1e-4
        assert row.visible_opening_px == into_opening
        assert row.measured_px == (part != Part.NONE).sum()
        assert row.visible_leaf_px == (part == Part.LEAF).sum()
        assert row.visible_frame_px == (part == Part.FRAME).sum()


def test_pixels_of_an_opening_straight_ahead() -> None:
    # 2 m before the door, 1 m high: 0.9 m wide, and from 1 m below to the image's upper edge.
    row = simulate_rows(PRESETS["ogurob-fixed"], 0, AHEAD)[0][2]
    camera = row.camera.intrinsics()
    rays = depth_to_points(np.ones((480, 640), np.float32), camera)
    offset = math.radians(row.heading_deg + 90)
    across = 2 / (np.cos(offset) - rays[..., 1] * np.sin(offset))  # z-depth of the wall's face
    sideways = across * (np.sin(offset) + rays[..., 1] * np.cos(offset))
    inside = (np.abs(sideways) < 0.45) & (across * rays[..., 2] > -1)
    # The open leaf stands on the left and hides only a strip at the opening's edge.
    assert 0.9 * inside.sum() < row.visible_opening_px <= inside.sum()


def test_states_with_identical_images_are_recorded() -> None:
    rows, frames = simulate_rows(
        PRESETS["ogurob-away"], 0, 24
    )  # the leaf swings out of sight behind the wall
    assert [row.same_image_as for row in rows] == ["", "open", "semi_open"]
    np.testing.assert_allclose(frames[1].cut.depth_m, frames[2].cut.depth_m, atol=1e-4)
    assert rows[1].visible_leaf_px == rows[2].visible_leaf_px == 0


def test_states_that_differ_in_noise_alone_count_as_identical() -> None:
    rows = simulate_rows(small("ogurob-away"), 0, 24, "gaussian:0.01")[0]
    assert [row.same_image_as for row in rows] == ["", "open", "semi_open"]
    assert len({row.depth_sha256 for row in rows}) == 3


@pytest.mark.parametrize("index", [0, 24, 600, 1352])
def test_a_door_that_opens_towards_the_robot_has_no_identical_images(index: int) -> None:
    assert [row.same_image_as for row in simulate_rows(small("ogurob"), 0, index)[0]] == ["", "", ""]


def test_a_sensor_changes_the_measurement_alone() -> None:
    described = {"sensor", "depth_sha256", "measured_px", "visible_leaf_px", "visible_frame_px"}
    for clean, noisy in zip(simulated("none"), simulated("gaussian:0.02"), strict=True):
        assert clean.model_dump_json(exclude=described) == noisy.model_dump_json(exclude=described)
        clean_frame, noisy_frame = replay(clean), replay(noisy)
        assert clean_frame.full.depth_m.tobytes() == noisy_frame.full.depth_m.tobytes()
        error_m = clean_frame.cut.depth_m - noisy_frame.cut.depth_m
        assert np.std(error_m[np.isfinite(error_m)]) == pytest.approx(0.02, rel=0.05)


def test_an_unknown_sensor_is_refused() -> None:
    with pytest.raises(ConfigError) as refused:
        simulate_rows(small("varied"), 0, 5, "xtions")
    assert refused.value.field == "sensor"


def test_varied_frames_measure_most_pixels_and_show_the_door() -> None:
    rows = [row for index in range(60) for row in simulate_rows(small("varied"), 0, index)[0]]
    pixels = 80 * 60
    door = (
        np.array([row.visible_leaf_px + row.visible_frame_px + row.visible_opening_px for row in rows])
        / pixels
    )
    assert min(row.measured_px for row in rows) > 0.4 * pixels
    assert door.min() > 0.02
    assert np.median(door) > 0.25
    # Identical images stay rare, and name each other.
    identical = [row for row in rows if row.same_image_as]
    assert len(identical) < 0.08 * len(rows)
    names = {row.sample_id for row in identical}
    for row in identical:
        assert all(f"{row.scene_id}-{state}" in names for state in row.same_image_as.split())
