# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.finder on simulated frames and on those of Gazebo."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.finder import FinderSettings, find_doorways, thinned
from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CAMERAS
from doorstate.simulation.frames import Frame, level
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.row import Row
from doorstate.simulation.truth import true_doors
from doorstate.types import Points

_GAZEBO = Path(__file__).resolve().parents[1] / "fixtures" / "gazebo"
_NEAR_M, _NEAR_DEG = 0.35, 20.0  # within which a network corrects a candidate


@cache
def _samples() -> list[tuple[Row, Frame]]:
    samples = []
    for index in range(4):
        samples += list(zip(*simulate_rows(PRESETS["varied"], 77, index, "xtion"), strict=True))
    return samples


def _hits(doorways: list[Doorway], x_m: float, y_m: float, yaw_deg: float) -> list[bool]:
    return [
        math.hypot(doorway.x_m - x_m, doorway.y_m - y_m) <= _NEAR_M
        and abs(math.remainder(doorway.yaw_deg - yaw_deg, 360)) <= _NEAR_DEG
        for doorway in doorways
    ]


def test_doors_of_simulated_frames_are_among_the_candidates() -> None:
    hits = []
    for row, frame in _samples():
        (door,) = true_doors(row)
        doorways = find_doorways(frame.points, door.floor_z_m)
        assert 1 <= len(doorways) <= 8
        hits.append(any(_hits(doorways, door.x_m, door.y_m, door.yaw_deg)))
    assert sum(hits) >= len(hits) - 1


def test_doors_of_gazebo_frames_are_among_the_candidates() -> None:
    scenes = json.loads((_GAZEBO / "scenes.json").read_text(encoding="utf-8"))
    with np.load(_GAZEBO / "depth.npz") as stored:
        depths = stored["depth"]
    missed = []
    for scene, depth_m in zip(scenes, depths, strict=True):
        camera = scene["camera"]
        cos, sin = math.cos(camera["yaw"]), math.sin(camera["yaw"])
        points = depth_to_points(depth_m, CAMERAS["xtion-gazebo"].intrinsics())
        doorways = find_doorways(level(points, camera["pitch"]), -camera["z"])
        x_m = -camera["x"] * cos - camera["y"] * sin
        y_m = camera["x"] * sin - camera["y"] * cos
        if not any(_hits(doorways, x_m, y_m, math.degrees(-camera["yaw"]))):
            missed.append(scene["name"])
    assert missed == []


def test_candidates_are_ranked_apart_and_replayable() -> None:
    _, frame = _samples()[0]
    doorways = find_doorways(frame.points)
    assert doorways == find_doorways(frame.points.copy())
    scores = [doorway.score for doorway in doorways]
    assert scores == sorted(scores, reverse=True)
    assert find_doorways(frame.points, settings=FinderSettings(most=1)) == doorways[:1]
    for number, doorway in enumerate(doorways):
        others = doorways[:number]
        assert not any(
            math.hypot(doorway.x_m - other.x_m, doorway.y_m - other.y_m) < 0.1
            and abs(math.remainder(doorway.yaw_deg - other.yaw_deg, 360)) < 10
            for other in others
        )


def test_a_flat_cloud_gives_the_doorways_of_its_image() -> None:
    row, frame = _samples()[2]
    (door,) = true_doors(row)
    flat = frame.points.reshape(-1, 3)
    flat = np.random.default_rng(0).permutation(flat[np.isfinite(flat).all(axis=1)])
    assert any(_hits(find_doorways(flat, door.floor_z_m), door.x_m, door.y_m, door.yaw_deg))


@pytest.mark.parametrize(
    "cloud",
    [
        np.empty((0, 3), np.float32),
        np.full((4, 5, 3), np.nan, np.float32),
        np.ones((1, 3), np.float32),
        np.random.default_rng(0).normal(0, 1e-3, (500, 3)).astype(np.float32),
        np.column_stack([np.linspace(1, 4, 999), np.zeros(999), np.full(999, -1.0)]).astype(np.float32),
    ],
    ids=["empty", "unmeasured", "point", "blob", "floor"],
)
def test_clouds_without_walls_have_no_doorways(cloud: Points) -> None:
    assert find_doorways(cloud) == []


def test_large_clouds_are_thinned() -> None:
    cloud = np.random.default_rng(0).uniform(1, 4, (480, 640, 3)).astype(np.float32)
    assert 20_000 < len(thinned(cloud)) <= 45_000
    assert len(thinned(cloud.reshape(-1, 3))) <= 45_000
