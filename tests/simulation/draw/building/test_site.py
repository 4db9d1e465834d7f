# SPDX-License-Identifier: Apache-2.0
"""Views of one building: six doors of one style in rooms that stay as they are, and a camera with constant errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.dataset.frame_index import read_index
from doorstate.io.options import ReadOptions
from doorstate.io.readers import read_cloud
from doorstate.simulation.camera import CameraBias, DepthCamera
from doorstate.simulation.draw.building.site import DOORS, draw_site
from doorstate.simulation.frames import depth_sha256, replay
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.presets import PRESETS, Preset, draw_rows
from doorstate.simulation.settings import SimulationSettings
from doorstate.simulation.writer import simulate_dataset
from doorstate.types import STATES

SMALL = Preset(name="site", camera=DepthCamera(width=160, height=120))
VIEWS = [draw_rows(PRESETS["site"], 5, index) for index in range(5 * DOORS)]


def test_six_doors_of_one_style_take_turns() -> None:
    assert [rows[0].scene_id for rows in VIEWS[:7]] == [f"site-5-d{number % 6}" for number in range(7)]
    assert len({rows[0].pose_id for rows in VIEWS}) == len(VIEWS)
    assert all([row.state for row in rows] == list(STATES) for rows in VIEWS)
    doors = [
        door
        for rows in VIEWS
        for door in (rows[0].scene.door, *(one.door for one in rows[0].scene.other_doors))
    ]
    assert len({door.model_dump_json(exclude={"hinge", "swing"}) for door in doors}) == 1


def test_the_rooms_of_a_door_stay_and_people_come_and_go() -> None:
    scenes = [rows[0].scene for rows in VIEWS if rows[0].scene_id == "site-5-d1"]
    assert len({scene.model_dump_json(exclude={"people"}) for scene in scenes}) == 1
    assert len({scene.people for scene in scenes}) > 1
    assert len({rows[0].scene.model_dump_json(exclude={"people"}) for rows in VIEWS}) == DOORS


def test_one_camera_looks_at_all_doors() -> None:
    rows = [rows[0] for rows in VIEWS]
    assert len({(row.camera_height_m, row.bias) for row in rows}) == 1
    for angles in ([row.pitch_deg for row in rows], [row.roll_deg for row in rows]):
        assert 0 < max(angles) - min(angles) <= 2
    assert draw_site(5).mount.bias != draw_site(6).mount.bias


def test_views_are_drawn_and_rendered_again() -> None:
    draw_site.cache_clear()
    assert draw_rows(PRESETS["site"], 5, 8) == VIEWS[8]
    for row in simulate_rows(SMALL, 5, 8)[0]:
        again = unflatten(flatten(row))
        assert again == row
        assert depth_sha256(replay(again)) == row.depth_sha256


def test_a_biased_camera_measures_other_depths_and_tells_another_tilt() -> None:
    row = draw_rows(SMALL, 5, 8)[0]
    bias = CameraBias(pitch_deg=2.0, roll_deg=-1.0, depth_factor=1.02)
    true = replay(row.model_copy(update={"bias": None}))
    biased = replay(row.model_copy(update={"bias": bias}))
    np.testing.assert_allclose(biased.cut.depth_m, 1.02 * true.cut.depth_m, rtol=1e-6)
    measured = np.isfinite(true.cut.depth_m)
    ranges_m = [np.linalg.norm(frame.points[measured], axis=-1) for frame in (true, biased)]
    np.testing.assert_allclose(ranges_m[1], 1.02 * ranges_m[0], rtol=1e-4)
    # Points of a camera that looks down less than it tells are turned down by the difference.
    ahead = np.argmin(np.abs(true.points[measured][:, 1]))
    turned = [
        math.atan2(frame.points[measured][ahead, 2], frame.points[measured][ahead, 0])
        for frame in (true, biased)
    ]
    assert math.degrees(turned[1] - turned[0]) == pytest.approx(-2.0, abs=0.1)
    assert "bias.pitch_deg" not in flatten(row.model_copy(update={"bias": None}))


def test_depth_images_are_read_as_the_camera_tells(tmp_path) -> None:
    settings = SimulationSettings(preset=SMALL, seed=5, poses=2, raw=("depth",))
    simulate_dataset(tmp_path, settings, workers=1)
    entries = read_index(tmp_path / "depth", ReadOptions())
    assert {entry[0]["door"] for entry in entries} == {"site-5-d0", "site-5-d1"}
    line, options = entries[0][:2]
    row = draw_rows(SMALL, 5, 0)[0]
    assert line["file"] == f"closed/{row.sample_id}.png"
    points, rendered = read_cloud(tmp_path / "depth" / line["file"], options), replay(row).points
    np.testing.assert_allclose(points, rendered, atol=2e-3)
