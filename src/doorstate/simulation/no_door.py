# SPDX-License-Identifier: Apache-2.0
"""Walls without a door: plain, cornered, with a cupboard, window, niche or passage (rules in docs/data-card.md)."""

from __future__ import annotations

from typing import Literal, get_args

from doorstate._models import FrozenModel
from doorstate.simulation.draws import Draws
from doorstate.simulation.scene import Box
from doorstate.types import Part

FeatureKind = Literal["wall", "inner_corner", "outer_corner", "cupboard", "window", "niche", "passage"]
FEATURES: tuple[FeatureKind, ...] = get_args(FeatureKind)

_LONG_M = 6.0
_BACK_M = 0.1
_FRONT_M, _GAP_M, _PLINTH_M, _KNOB_M = 0.018, 0.003, 0.08, 0.025
_CASEMENT_M, _PANE_M = 0.06, 0.02


class Feature(FrozenModel):
    """What is in, or before, a wall instead of a door; its middle is the origin of the door frame."""

    kind: FeatureKind
    wall_thickness_m: float
    wall_height_m: float
    floor_size_m: float = 16.0
    width_m: float = 0.0
    bottom_m: float = 0.0
    top_m: float = 0.0
    depth_m: float = 0.0
    fronts: int = 0  # of a cupboard
    corner_m: float = 0.0  # where the wall turns


def draw_feature(draws: Draws, robot_x_m: float) -> Feature:
    """All kinds equally often; sizes as in the data card."""
    kind = draws.one_of(dict.fromkeys(FEATURES, 1.0))
    wall = Feature(
        kind=kind, wall_thickness_m=draws.between(0.08, 0.30), wall_height_m=draws.between(2.4, 3.2)
    )
    return wall.model_copy(update=_sizes(draws, kind, robot_x_m))


def _sizes(draws: Draws, kind: FeatureKind, robot_x_m: float) -> dict[str, float]:
    if kind in ("inner_corner", "outer_corner"):
        # On the side where the robot is not, so that it stands before the wall and sees the corner.
        side = -1.0 if robot_x_m > 0 else 1.0
        return {"corner_m": side * draws.between(0.25, 1.0)}
    if kind == "cupboard":
        fronts = draws.whole(1, 2)
        return {
            "fronts": fronts,
            "width_m": round(fronts * draws.between(0.40, 0.60), 4),
            "top_m": draws.between(1.6, 2.3),
            "depth_m": draws.between(0.30, 0.60),
        }
    if kind == "window":
        return {
            "width_m": draws.between(0.6, 1.6),
            "bottom_m": draws.between(0.5, 1.1),
            "top_m": draws.between(1.9, 2.3),
        }
    if kind == "niche":
        return {
            "width_m": draws.between(0.6, 1.5),
            "bottom_m": 0.0 if draws.chance(0.5) else draws.between(0.3, 1.0),
            "top_m": draws.between(1.8, 2.3),
            "depth_m": draws.between(0.15, 0.60),
        }
    if kind == "passage":
        return {"width_m": draws.between(0.8, 2.0), "top_m": draws.between(2.0, 2.4)}
    return {}


def feature_boxes(feature: Feature) -> list[Box]:
    """The wall and what is in it, in the door frame (scene.py)."""
    match feature.kind:
        case "inner_corner" | "outer_corner":
            return _corner(feature)
        case "cupboard":
            return [*_pierced(feature, feature.wall_thickness_m, 0.0), *_cupboard(feature)]
        case "window":
            return [*_pierced(feature, feature.wall_thickness_m, feature.width_m), *_window(feature)]
        case "niche":
            back = (2 * _LONG_M, _BACK_M, feature.wall_height_m)
            center = (0.0, -feature.depth_m - _BACK_M / 2, feature.wall_height_m / 2)
            return [*_pierced(feature, feature.depth_m, feature.width_m), Box(Part.WALL, center, back)]
        case _:
            return _pierced(feature, feature.wall_thickness_m, feature.width_m)


def _pierced(feature: Feature, thickness: float, hole_m: float) -> list[Box]:
    """A wall with a hole from `bottom_m` to `top_m`, or without one."""
    height, y = feature.wall_height_m, -thickness / 2
    if not hole_m:
        return [Box(Part.WALL, (0.0, y, height / 2), (2 * _LONG_M, thickness, height))]
    beside = _LONG_M - hole_m / 2
    boxes = [
        Box(Part.WALL, (side * (_LONG_M - beside / 2), y, height / 2), (beside, thickness, height))
        for side in (1, -1)
    ]
    for low, high in ((0.0, feature.bottom_m), (feature.top_m, height)):
        if high > low:
            boxes.append(Box(Part.WALL, (0.0, y, (low + high) / 2), (hole_m, thickness, high - low)))
    return boxes


def _corner(feature: Feature) -> list[Box]:
    """The wall ends at the corner; another goes on from there, towards the robot (inner) or away from it (outer)."""
    thickness, height, corner = feature.wall_thickness_m, feature.wall_height_m, feature.corner_m
    side = 1.0 if corner > 0 else -1.0
    length = _LONG_M + abs(corner)
    wall = Box(
        Part.WALL, (corner - side * length / 2, -thickness / 2, height / 2), (length, thickness, height)
    )
    inner = feature.kind == "inner_corner"
    x = corner + (side if inner else -side) * thickness / 2
    y = (_LONG_M - thickness) / 2 if inner else -_LONG_M / 2
    return [
        wall,
        Box(Part.WALL, (x, y, height / 2), (thickness, _LONG_M + (thickness if inner else 0), height)),
    ]


def _cupboard(feature: Feature) -> list[Box]:
    """A carcass on a plinth, with one or two closed fronts and a knob on each."""
    width, depth, top = feature.width_m, feature.depth_m, feature.top_m
    body = depth - _FRONT_M
    middle = (_PLINTH_M + top) / 2
    boxes = [
        Box(Part.OTHER, (0.0, (body - 0.05) / 2, _PLINTH_M / 2), (width - 0.02, body - 0.05, _PLINTH_M)),
        Box(Part.OTHER, (0.0, body / 2, middle), (width, body, top - _PLINTH_M)),
    ]
    one = width / feature.fronts
    for number in range(feature.fronts):
        x = (number + 0.5) * one - width / 2
        size = (one - _GAP_M, _FRONT_M, top - _PLINTH_M - _GAP_M)
        boxes.append(Box(Part.OTHER, (x, body + _FRONT_M / 2, middle), size))
        towards_middle = -1.0 if x > 0 else 1.0
        knob_x = x + towards_middle * (one / 2 - 0.05)
        boxes.append(Box(Part.OTHER, (knob_x, depth + _KNOB_M / 2, 1.0), (_KNOB_M, _KNOB_M, _KNOB_M)))
    return boxes


def _window(feature: Feature) -> list[Box]:
    """A casement around a pane, in the middle of the wall's thickness."""
    width, low, high = feature.width_m, feature.bottom_m, feature.top_m
    y, z, bar = -feature.wall_thickness_m / 2, (low + high) / 2, _CASEMENT_M
    inner = width - 2 * bar
    posts = [
        Box(Part.OTHER, (x, y, z), (bar, bar, high - low)) for x in ((bar - width) / 2, (width - bar) / 2)
    ]
    rails = [Box(Part.OTHER, (0.0, y, at), (inner, bar, bar)) for at in (low + bar / 2, high - bar / 2)]
    pane = Box(Part.OTHER, (0.0, y, z), (inner, _PANE_M, high - low - 2 * bar), material="glass")
    return [*posts, *rails, pane]
