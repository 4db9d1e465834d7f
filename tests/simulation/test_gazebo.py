# SPDX-License-Identifier: Apache-2.0
"""Twenty frames rendered by Gazebo 11.1: our renderer gives the same depth, and our doors the same boxes."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from doorstate.simulation.camera import CAMERAS, CameraPose
from doorstate.simulation.render import cut_range, render
from doorstate.simulation.scene import Box, Door, Opening, Scene, scene_boxes
from doorstate.types import Part

GAZEBO = Path(__file__).resolve().parents[1] / "fixtures" / "gazebo"
FRAMES: list[dict[str, Any]] = json.loads((GAZEBO / "scenes.json").read_text(encoding="utf-8"))
# Frames with side walls, ceilings or furniture in addition to the door.
FURNISHED = {15, 16, 17, 19}


def fixture_boxes(frame: dict[str, Any]) -> list[Box]:
    return [
        Box(Part[box["part"].upper()], tuple(box["center"]), tuple(box["size"]), box["yaw"])
        for box in frame["boxes"]
    ]


def corners(box: Box) -> NDArray[np.float64]:
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    rotation = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return signs * np.array(box.size_m) @ rotation.T + np.array(box.center_m)  # (8, 3)


def same_box(box: Box, target: Box) -> bool:
    apart = np.linalg.norm(corners(box)[:, None] - corners(target)[None], axis=-1)
    return box.part == target.part and max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-4


def matches(boxes: Sequence[Box], targets: Sequence[Box]) -> list[list[int]]:
    """Return, for every box, the numbers of the equal boxes."""
    return [[number for number, target in enumerate(targets) if same_box(box, target)] for box in boxes]


def test_rendering_equals_gazebo() -> None:
    with np.load(GAZEBO / "depth.npz") as stored:
        expected = stored["depth"]
    camera = CAMERAS["xtion-gazebo"]
    rendered = np.empty_like(expected)
    for number, frame in enumerate(FRAMES):
        camera_pose = frame["camera"]
        pose = CameraPose(*(camera_pose[name] for name in ("x", "y", "z", "yaw", "pitch")))
        rendered[number] = cut_range(render(fixture_boxes(frame), pose, camera.intrinsics()), camera).depth_m
    assert expected.shape == (20, 480, 640)
    measured = np.isfinite(expected)
    assert measured.mean() > 0.5
    one_sided = int((measured != np.isfinite(rendered)).sum())
    apart_m = np.abs(expected - rendered)[measured & np.isfinite(rendered)]
    assert np.quantile(apart_m, 0.999) < 1e-4
    assert one_sided + int((apart_m > 1e-3).sum()) < 1e-4 * expected.size


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: frame["name"])
def test_the_boxes_of_the_door_equal_those_of_gazebo(frame: dict[str, Any]) -> None:
    door = Door(hinge=frame["hinge"], swing=frame["swing"])
    ours = scene_boxes(Scene(door=door, has_ceiling=False), Opening(angle_deg=frame["opening_angle_deg"]))
    theirs = fixture_boxes(frame)
    equal = matches(ours, theirs)
    assert all(len(match) == 1 for match in equal)
    assert len({match[0] for match in equal}) == len(ours)
    extra = len(theirs) - len(ours)
    assert extra > 0 if frame["index"] in FURNISHED else extra == 0
