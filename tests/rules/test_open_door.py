# SPDX-License-Identifier: Apache-2.0
"""Openings between known planes, and images without an opening."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from doorstate.rules.open_door import OpenDoorParameters, OpenDoorRule
from doorstate.types import DoorState

HALF_M = 0.45
Board = tuple[float, float, float, float]  # an upright plane in plan view, from (x, y) to (x, y)
WALL: list[Board] = [(-5.0, 0.0, -HALF_M, 0.0), (HALF_M, 0.0, 5.0, 0.0)]


def leaf(angle_deg: float, side: float = 1.0) -> Board:
    """On the jamb at +x (side 1) or -x, towards the camera, which is at y > 0."""
    turn = math.radians(angle_deg)
    return (side * HALF_M, 0.0, side * (HALF_M - 0.9 * math.cos(turn)), 0.9 * math.sin(turn))


def render(
    boards: list[Board],
    x_m: float,
    y_m: float,
    *,
    camera_height_m: float = 1.0,
    lintel_m: float = 5.0,
    floor: bool = True,
) -> NDArray[np.float64]:
    """Organized cloud (240, 320, 3) of boards, a lintel between the wall's parts and a floor, looking at the door."""
    heading = math.atan2(-y_m, -x_m)
    cos, sin = math.cos(heading), math.sin(heading)
    across = -np.linspace(-0.577, 0.577, 320)
    rise = np.broadcast_to(-np.linspace(-0.43, 0.43, 240)[:, None], (240, 320))
    below = np.where(rise < 0, -camera_height_m / np.minimum(rise, -1e-9), np.inf)
    depth = below if floor else np.full(rise.shape, np.inf)
    above: Board = (-HALF_M, 0.0, HALF_M, 0.0)
    for (from_x, from_y, to_x, to_y), lowest in [*((board, 0.0) for board in boards), (above, lintel_m)]:
        ray_x, ray_y = cos - sin * across, sin + cos * across
        edge_x, edge_y = to_x - from_x, to_y - from_y
        start_x, start_y = from_x - x_m, from_y - y_m
        cross = ray_x * edge_y - ray_y * edge_x
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = (start_x * edge_y - start_y * edge_x) / cross
            along = (start_x * ray_y - start_y * ray_x) / cross
        hit = (ahead > 0) & (along >= 0) & (along <= 1)
        reached = np.broadcast_to(np.where(hit, ahead, np.inf), rise.shape)
        height_m = np.where(np.isfinite(reached), reached, 0.0) * rise + camera_height_m
        depth = np.where((height_m >= lowest) & (reached < depth), reached, depth)
    depth = np.where((depth > 0.4) & (depth < 5.0), depth, np.nan)
    return np.stack([depth, depth * across, depth * rise], axis=-1)


PLACES = [(0.0, 2.5), (-0.8, 2.2), (1.0, 2.6), (-1.7, 1.7), (2.0, 1.2)]


@pytest.mark.parametrize(("x_m", "y_m"), PLACES)
@pytest.mark.parametrize("floor", [True, False])
def test_an_opening_between_two_parts_of_a_wall_is_open(x_m: float, y_m: float, floor: bool) -> None:
    result = OpenDoorRule()(render(WALL, x_m, y_m, floor=floor))
    assert result.state is DoorState.OPEN
    assert result.open_or_not is True
    assert result.opening_width_m == pytest.approx(0.9, abs=0.03)


def test_the_outline_is_the_opening_in_the_sensor_frame() -> None:
    result = OpenDoorRule()(render(WALL, 0.0, 3.0, lintel_m=2.0))
    shapes = [(shape.name, shape.points_m) for shape in result.detections]
    (outline,) = (points for name, points in shapes if name == "opening")
    # From 3 m, x of the scene is left of the camera; the lintel's lower edge is 1 m above it.
    np.testing.assert_allclose(outline[:, 0], 3.0, atol=0.02)
    np.testing.assert_allclose(outline[:, 1], [0.45, 0.45, -0.45, -0.45], atol=0.03)
    np.testing.assert_allclose(outline[1:3, 2], 1.0, atol=0.03)
    edges = [points for name, points in shapes if name == "edge"]
    assert [edge.shape for edge in edges] == [(2, 3), (2, 3)]
    corners = [points for name, points in shapes if name == "corner"]
    np.testing.assert_array_equal(np.concatenate(corners), outline)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("angle_deg", [75, 90, 115])
@pytest.mark.parametrize(("x_m", "y_m"), [(-0.2, 2.9), (-1.2, 2.4), (0.4, 2.9)])
def test_a_leaf_beside_the_opening_leaves_it_open(
    x_m: float, y_m: float, angle_deg: float, side: float
) -> None:
    result = OpenDoorRule()(render([*WALL, leaf(angle_deg, side)], side * x_m, y_m))
    assert result.open_or_not is True
    assert result.opening_width_m == pytest.approx(0.9, abs=0.04)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("angle_deg", [20, 35, 45, 60, 65])
@pytest.mark.parametrize(("x_m", "y_m"), [(-0.2, 2.9), (-1.2, 2.4), (0.4, 2.9), (-2.0, 1.2)])
def test_a_half_open_leaf_is_not_open(x_m: float, y_m: float, angle_deg: float, side: float) -> None:
    result = OpenDoorRule()(render([*WALL, leaf(angle_deg, side)], side * x_m, y_m))
    assert result.state is None
    assert result.open_or_not is False
    assert result.reason


@pytest.mark.parametrize(("x_m", "y_m"), PLACES)
def test_a_wall_without_an_opening_is_not_open(x_m: float, y_m: float) -> None:
    result = OpenDoorRule()(render([(-5.0, 0.0, 5.0, 0.0)], x_m, y_m))
    assert result.state is None
    assert result.open_or_not is False


@pytest.mark.parametrize("half_m", [0.25, 0.7])
def test_an_opening_of_another_width_is_no_door(half_m: float) -> None:
    boards = [(-5.0, 0.0, -half_m, 0.0), (half_m, 0.0, 5.0, 0.0)]
    assert OpenDoorRule()(render(boards, 0.0, 3.0)).open_or_not is False


def test_a_room_behind_the_opening_is_seen_through_it() -> None:
    behind = (-5.0, -1.5, 5.0, -1.5)
    assert OpenDoorRule()(render([*WALL, behind], 0.3, 2.5)).open_or_not is True


def test_a_niche_is_no_opening() -> None:
    niche = [(side, 0.0, side, -0.2) for side in (-HALF_M, HALF_M)]
    cloud = render([*WALL, *niche, (-HALF_M, -0.2, HALF_M, -0.2)], 0.3, 2.5)
    assert OpenDoorRule()(cloud).open_or_not is False


def test_two_posts_without_a_wall_are_no_door() -> None:
    posts = [(side * HALF_M, 0.0, side * (HALF_M + 0.08), 0.0) for side in (-1.0, 1.0)]
    assert OpenDoorRule()(render(posts, 0.0, 2.5, floor=False)).open_or_not is False


def test_single_dropouts_neither_make_an_opening_nor_hide_one() -> None:
    dropped = np.random.default_rng(0).random((240, 320)) < 0.05
    opened, shut = render(WALL, 0.3, 2.5), render([(-5.0, 0.0, 5.0, 0.0)], 0.3, 2.5)
    opened[dropped] = np.nan
    shut[dropped] = 0.0
    assert OpenDoorRule()(opened.astype(np.float32)).open_or_not is True
    assert OpenDoorRule()(shut.astype(np.float32)).open_or_not is False


def test_widths_are_parameters() -> None:
    rule = OpenDoorRule(OpenDoorParameters(door_width_m=(0.95, 1.25)))
    assert rule(render(WALL, 0.0, 2.5)).open_or_not is False


def test_a_flat_cloud_has_no_state() -> None:
    result = OpenDoorRule()(np.ones((500, 3), dtype=np.float32))
    assert result.state is None
    assert result.open_or_not is None
    assert result.reason


@pytest.mark.parametrize("nothing", [np.nan, 0.0])
@pytest.mark.parametrize("shape", [(48, 64, 3), (0, 0, 3), (1, 1, 3)])
def test_an_empty_image_has_no_state(nothing: float, shape: tuple[int, int, int]) -> None:
    result = OpenDoorRule()(np.full(shape, nothing, dtype=np.float32))
    assert result.state is None
    assert result.open_or_not is None
    assert result.reason


def test_one_reading_is_not_open() -> None:
    assert OpenDoorRule()(np.ones((1, 1, 3), dtype=np.float32)).open_or_not is False
