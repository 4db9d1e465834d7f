# SPDX-License-Identifier: Apache-2.0
"""Matching sensors as a whole: published figures, emitter and sun, parts at edges."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from paper.measurements.optical_sensors import AT_LEAST, AT_MOST, measure_optical
from paper.measurements.sensors import AHEAD, SensorResult, cropped, wall

from doorstate.simulation.camera import CameraPose
from doorstate.simulation.noise.conditions import Conditions
from doorstate.simulation.noise.model import distort, sense
from doorstate.simulation.noise.sensors import SENSORS, STAGE_SENSORS
from doorstate.simulation.render import render_behind_glass
from doorstate.simulation.scene import Box, Door, Opening, Scene, scene_boxes
from doorstate.types import Part

POSE = CameraPose.from_degrees((0.4, 2.2, 1.0), -97.0, 3.0)
BOXES = scene_boxes(Scene(door=Door(hinge="right"), has_ceiling=False), Opening(angle_deg=50))


@pytest.fixture(scope="module")
def checks() -> list[SensorResult]:
    return list(measure_optical(range(4)))


def test_sensors_agree_with_published_values_within_ten_per_cent(checks: list[SensorResult]) -> None:
    limits = [row for row in checks if row.quantity.endswith((AT_MOST, AT_LEAST))]
    assert [row for row in limits if row.quantity.endswith(AT_MOST) and row.measured > row.published] == []
    assert [row for row in limits if row.quantity.endswith(AT_LEAST) and row.measured < row.published] == []
    equal = [row for row in checks if row not in limits]
    assert [row for row in equal if not abs(row.measured / row.published - 1) < 0.1] == []
    assert len(equal) > 40
    assert {row.sensor for row in checks} == set(SENSORS) - set(STAGE_SENSORS)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("xtion-matching", "fc3d2bb5544079e04538fa48be48163a6327ce2747922176b2e7706a5c70c008"),
        ("d435-matching", "ab1419063f02ab04711d5a3ce3b70452969db4f93bc4bb04992ea9ed72abe276"),
        ("azure-kinect", "a70498fa03a4b7588d9e05c1146b5f4c9488e232efc3c13c52728c97991883c3"),
    ],
)
def test_measurements_have_the_same_bits_on_every_machine(name: str, expected: str) -> None:
    model = SENSORS[name]
    rendered = render_behind_glass(BOXES, POSE, model.camera.intrinsics())
    depth_m = sense(model, rendered, BOXES, POSE, model.camera, 2026).depth_m
    assert hashlib.sha256(depth_m.tobytes()).hexdigest() == expected


def measured_share(name: str, conditions: Conditions, depth_m: float = 2.0) -> float:
    model, boxes = SENSORS[name], [wall(depth_m)]
    pinhole = cropped(model, 80, 60)
    rendered = render_behind_glass(boxes, AHEAD, pinhole)
    images = [distort(model, rendered, boxes, AHEAD, pinhole, seed, conditions).depth_m for seed in range(20)]
    return float(np.isfinite(images)[..., 20:].mean())


def test_without_its_emitter_stereo_loses_about_half_and_structured_light_all() -> None:
    off = Conditions(emitter_on=False)
    assert measured_share("d435-matching", Conditions()) > 0.95
    assert measured_share("d435-matching", off) == pytest.approx(0.4, abs=0.15)
    assert measured_share("oak-d", Conditions()) == pytest.approx(measured_share("oak-d", off))
    assert measured_share("xtion-matching", off) < 0.05


@pytest.mark.parametrize("name", ["xtion-matching", "kinect-2"])
def test_sunlight_shortens_the_reach(name: str) -> None:
    dark, sunny = Conditions(), Conditions(sun_share=1.0)
    assert measured_share(name, dark, 3.0) > 0.95
    assert measured_share(name, sunny, 3.0) < 0.05
    assert measured_share(name, sunny, 0.5) > 0.95


def test_edges_grow_with_their_part() -> None:
    model = SENSORS["kinect-matching"]
    boxes = [Box(Part.LEAF, (2.0, -5.0, 0.0), (0.02, 10.0, 20.0)), wall(3.0)]
    pinhole = cropped(model, 60, 200)
    rendered = render_behind_glass(boxes, AHEAD, pinhole)
    measured = distort(model, rendered, boxes, AHEAD, pinhole, 0)
    seen = np.isfinite(measured.depth_m)
    assert ((measured.depth_m < 2.5) == (measured.part == Part.LEAF))[seen].all()
    assert ((measured.part == Part.LEAF) == (measured.box == 0)).all()
    grown = (measured.part == Part.LEAF).sum(axis=1) - (rendered.part == Part.LEAF).sum(axis=1)
    assert grown.min() >= 0
    assert grown.max() == model.window_px // 2
