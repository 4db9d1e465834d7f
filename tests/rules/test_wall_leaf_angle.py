# SPDX-License-Identifier: Apache-2.0
"""Angles of leaves in scenes of known planes, and scenes without a result."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from doorstate.io.depth import depth_to_points
from doorstate.rules.wall_leaf_angle import WallLeafAngleRule
from doorstate.simulation.camera import CAMERAS
from doorstate.simulation.frames import level
from doorstate.types import DoorState

GAZEBO = Path(__file__).resolve().parents[1] / "fixtures" / "gazebo"
HEIGHT_M = 1.0
HALF_M = 0.45
Board = tuple[float, float, float, float]  # an upright plane in plan view, from (x, y) to (x, y), 2.1 m high


def wall(half_m: float = HALF_M) -> list[Board]:
    """A wall along y = 0 with an opening in the middle; the robot is at y > 0."""
    return [(half_m, 0.0, 5.0, 0.0), (-5.0, 0.0, -half_m, 0.0)]


def leaf(angle_deg: float, hinge: float = 1.0, swing: float = 1.0, length_m: float = 0.9) -> Board:
    """Hinge +1: at the left jamb; swing +1: towards the robot."""
    turn = math.radians(angle_deg)
    x = hinge * HALF_M
    return (x, 0.0, x - hinge * length_m * math.cos(turn), swing * length_m * math.sin(turn))


def render(
    boards: list[Board], x_m: float, y_m: float, turned_deg: float = 0.0, noise_m: float = 0.0
) -> NDArray[np.float32]:
    """Organized cloud (120, 320, 3) of boards and a floor, of a camera that looks at the opening, or beside it."""
    heading = math.atan2(-y_m, -x_m) + math.radians(turned_deg)
    across = -np.linspace(-0.577, 0.577, 320)  # 60 degrees, from left to right
    upward = -np.linspace(-0.43, 0.43, 120)
    slope = np.broadcast_to(across, (120, 320))
    rise = np.broadcast_to(upward[:, None], (120, 320))
    depth = np.where(rise < 0, -HEIGHT_M / np.minimum(rise, -1e-9), np.inf)
    cos, sin = math.cos(heading), math.sin(heading)
    ray = np.stack([cos - sin * across, sin + cos * across])  # (2, 320), one metre ahead
    for from_x, from_y, to_x, to_y in boards:
        edge = np.array([to_x - from_x, to_y - from_y])
        start = np.array([from_x - x_m, from_y - y_m])
        determinant = ray[1] * edge[0] - ray[0] * edge[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = (start[1] * edge[0] - start[0] * edge[1]) / determinant
            along = (ray[0] * start[1] - ray[1] * start[0]) / determinant
        hit = (ahead > 0) & (along >= 0) & (along <= 1)
        distance = np.broadcast_to(np.where(hit, ahead, np.inf), (120, 320))
        distance = np.where(distance * rise + HEIGHT_M <= 2.1, distance, np.inf)
        depth = np.minimum(depth, distance)
    depth = depth + np.random.default_rng(0).normal(0.0, 1.0, depth.shape) * noise_m
    depth[(depth < 0.4) | (depth > 5.0)] = np.nan
    return np.stack([depth, depth * slope, depth * rise], axis=-1).astype(np.float32)


VIEWS = [(0.0, 2.6, 0.0), (-1.0, 2.4, 0.0), (-1.4, 2.2, 10.0), (0.6, 2.8, -5.0)]


@pytest.mark.parametrize("hinge", [1.0, -1.0])
@pytest.mark.parametrize(("x_m", "y_m", "turned_deg"), VIEWS)
@pytest.mark.parametrize("angle_deg", [15, 25, 35, 45, 60, 65, 80, 100, 115])
def test_angle_and_state_are_those_of_the_leaf(
    angle_deg: float, x_m: float, y_m: float, turned_deg: float, hinge: float
) -> None:
    cloud = render([*wall(), leaf(angle_deg, hinge)], hinge * x_m, y_m, hinge * turned_deg)
    result = WallLeafAngleRule()(cloud)
    sight_deg = math.degrees(math.atan2(y_m, HALF_M - x_m))  # of the hinge
    edge_on = abs(sight_deg - angle_deg) < 2  # then the leaf's edge alone tells the angle
    assert result.opening_angle_deg == pytest.approx(angle_deg, abs=6 if edge_on else 2)
    assert result.state is (DoorState.SEMI_OPEN if angle_deg < 70 else DoorState.OPEN)
    assert result.open_or_not is (angle_deg >= 70)
    assert {"wall", "leaf"} <= {shape.name for shape in result.detections}


@pytest.mark.parametrize("angle_deg", [20, 40, 60])
def test_a_leaf_that_swings_away_opens_by_the_same_angle(angle_deg: float) -> None:
    result = WallLeafAngleRule()(render([*wall(), leaf(angle_deg, swing=-1.0)], 0.3, 2.2))
    assert result.opening_angle_deg == pytest.approx(angle_deg, abs=2)
    assert result.state is DoorState.SEMI_OPEN


def test_a_flat_cloud_gives_the_angle_too() -> None:
    cloud = render([*wall(), leaf(50)], -0.8, 2.4).reshape(-1, 3)
    result = WallLeafAngleRule()(cloud[np.isfinite(cloud).all(axis=1)])
    assert result.opening_angle_deg == pytest.approx(50, abs=2)


def test_noise_of_a_depth_camera_moves_the_angle_little() -> None:
    result = WallLeafAngleRule()(render([*wall(), leaf(50)], -0.8, 2.4, noise_m=0.008))
    assert result.state is DoorState.SEMI_OPEN
    assert result.opening_angle_deg == pytest.approx(50, abs=4)


def test_the_same_cloud_gives_the_same_angle() -> None:
    cloud = render([*wall(), leaf(33)], -0.8, 2.4, noise_m=0.008)
    assert WallLeafAngleRule()(cloud).opening_angle_deg == WallLeafAngleRule()(cloud).opening_angle_deg


@pytest.mark.parametrize("x_m", [-1.5, 0.0, 1.5])
def test_an_opening_without_a_leaf_is_open_and_has_a_width(x_m: float) -> None:
    result = WallLeafAngleRule()(render(wall(), x_m, 2.5))
    assert result.state is DoorState.OPEN
    assert result.opening_angle_deg is None
    assert result.opening_width_m == pytest.approx(0.9, abs=0.1)


def test_the_outline_of_the_opening_stands_in_the_opening() -> None:
    result = WallLeafAngleRule()(render(wall(), 0.0, 2.5))
    (opening,) = (shape.points_m for shape in result.detections if shape.name == "opening")
    # The camera looks along -y of the scene from 2.5 m: x ahead, and y to the left is x of the scene.
    np.testing.assert_allclose(opening[:, 0], 2.5, atol=0.05)
    np.testing.assert_allclose(np.sort(opening[:, 1]), [-0.45, -0.45, 0.45, 0.45], atol=0.06)


@pytest.mark.parametrize(("x_m", "y_m"), [(0.0, 2.5), (-1.5, 2.0), (2.0, 1.2)])
@pytest.mark.parametrize("recess_m", [0.0, 0.04, 0.11])
def test_a_wall_without_a_gap_is_closed_even_with_a_recessed_leaf(
    recess_m: float, x_m: float, y_m: float
) -> None:
    reveals = [(side, 0.0, side, -recess_m) for side in (-HALF_M, HALF_M)]
    cloud = render([*wall(), *reveals, (-HALF_M, -recess_m, HALF_M, -recess_m)], x_m, y_m)
    result = WallLeafAngleRule()(cloud)
    assert result.state is DoorState.CLOSED
    assert result.opening_angle_deg == 0.0
    assert result.open_or_not is False


def test_a_leaf_seen_edge_on_is_detected_by_its_edge() -> None:
    # The camera, the leaf's free edge and the hinge are on one line.
    turn = math.radians(60)
    tip = np.array([HALF_M - 0.9 * math.cos(turn), 0.9 * math.sin(turn)])
    edge = (tip[0] - 0.02, tip[1] - 0.01, tip[0] + 0.02, tip[1] + 0.01)
    ahead = 2.9
    cloud = render([*wall(), edge], HALF_M - ahead * math.cos(turn), ahead * math.sin(turn))
    result = WallLeafAngleRule()(cloud)
    assert result.state is DoorState.SEMI_OPEN
    assert result.opening_angle_deg == pytest.approx(60, abs=6)


def test_a_board_too_short_for_a_leaf_leaves_the_opening_open() -> None:
    result = WallLeafAngleRule()(render([*wall(), leaf(45, length_m=0.15)], -1.0, 2.4))
    assert result.state is DoorState.OPEN
    assert result.opening_angle_deg is None


def test_a_void_wider_than_a_door_has_no_state() -> None:
    result = WallLeafAngleRule()(render(wall(half_m=0.8), 0.0, 3.5))
    assert result.state is None
    assert result.reason


def test_a_single_short_plane_is_no_wall() -> None:
    result = WallLeafAngleRule()(render([(-0.4, 0.0, 0.4, 0.0)], 0.0, 2.5))
    assert result.state is None
    assert result.reason


def test_a_floor_alone_is_no_wall() -> None:
    result = WallLeafAngleRule()(render([], 0.0, 2.5))
    assert result.state is None
    assert result.reason


@pytest.mark.parametrize(
    "cloud",
    [
        np.empty((0, 3)),
        np.zeros((500, 3)),
        np.full((500, 3), np.nan),
        np.full((60, 80, 3), np.nan),
        np.ones((5, 3)),
        np.full((500, 3), 1e7),
        np.full((500, 3), (1.0, 0.0, 5.0)),
    ],
    ids=["empty", "zeros", "nan", "image of nan", "five points", "far away", "ceiling"],
)
def test_a_cloud_without_usable_points_has_no_state(cloud: NDArray[np.float64]) -> None:
    result = WallLeafAngleRule()(cloud.astype(np.float32))
    assert result.state is None
    assert result.reason


def test_points_that_are_all_one_are_no_wall() -> None:
    result = WallLeafAngleRule()(np.full((500, 3), (2.0, 0.0, 0.0), dtype=np.float32))
    assert result.state is None
    assert result.reason


def test_states_of_doors_rendered_by_gazebo() -> None:
    frames = json.loads((GAZEBO / "scenes.json").read_text(encoding="utf-8"))
    with np.load(GAZEBO / "depth.npz") as stored:
        depths = stored["depth"]
    correct = 0
    for frame, depth in zip(frames, depths, strict=True):
        camera = CAMERAS["xtion-gazebo"].intrinsics()
        result = WallLeafAngleRule()(level(depth_to_points(depth, camera), frame["camera"]["pitch"]))
        correct += result.state is not None and frame["name"].endswith(f"_{result.state}")
    assert correct >= 19
