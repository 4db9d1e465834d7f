# SPDX-License-Identifier: Apache-2.0
"""Walls without a door: plain, with a corner, cupboard, window, niche or passage (rules in docs/data-card.md)."""

from __future__ import annotations

from typing import Literal, get_args

from pydantic import Field

from doorstate._models import FrozenModel, Metres
from doorstate.simulation.scene.box import Box
from doorstate.types import Part

FeatureKind = Literal["wall", "inner_corner", "outer_corner", "cupboard", "window", "niche", "passage"]
FEATURES: tuple[FeatureKind, ...] = get_args(FeatureKind)

_LONG_M = 6.0
_BACK_M = 0.1
_FRONT_M, _GAP_M, _PLINTH_M, _KNOB_M = 0.018, 0.003, 0.08, 0.025
_CASEMENT_M, _PANE_M = 0.06, 0.02


class Feature(FrozenModel):
    """A wall without a door, and the object in or before it, whose middle is the origin of the door frame."""

    kind: FeatureKind
    wall_thickness_m: Metres
    wall_height_m: Metres
    floor_size_m: Metres = 16.0
    width_m: Metres = 0.0
    bottom_m: Metres = 0.0
    top_m: Metres = 0.0
    depth_m: Metres = 0.0
    fronts: int = Field(default=0, ge=0, le=20)  # of a cupboard
    corner_m: Metres = 0.0  # x of the corner


def feature_boxes(feature: Feature) -> list[Box]:
    """Return the wall and the object in or before it, in the door frame."""
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
    """Return a wall with a hole of this width from `bottom_m` to `top_m`; 0 is no hole."""
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
    """Return a wall up to the corner, and a second one towards the robot (inner) or away from it (outer)."""
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
    """Return a carcass on a plinth with one or two closed fronts, and a knob on each."""
    width, depth, top = feature.width_m, feature.depth_m, feature.top_m
    body = depth - _FRONT_M
    middle = (_PLINTH_M + top) / 2
    boxes = [
        Box(Part.OTHER, (0.0, (body - 0.05) / 2, _PLINTH_M / 2), (width - 0.02, body - 0.05, _PLINTH_M)),
        Box(Part.OTHER, (0.0, body / 2, middle), (width, body, top - _PLINTH_M)),
    ]
    front = width / feature.fronts
    for number in range(feature.fronts):
        x = (number + 0.5) * front - width / 2
        size = (front - _GAP_M, _FRONT_M, top - _PLINTH_M - _GAP_M)
        boxes.append(Box(Part.OTHER, (x, body + _FRONT_M / 2, middle), size))
        towards_middle = -1.0 if x > 0 else 1.0
        knob_x = x + towards_middle * (front / 2 - 0.05)
        boxes.append(Box(Part.OTHER, (knob_x, depth + _KNOB_M / 2, 1.0), (_KNOB_M, _KNOB_M, _KNOB_M)))
    return boxes


def _window(feature: Feature) -> list[Box]:
    """Return a casement around a pane, in the middle of the wall's thickness."""
    width, low, high = feature.width_m, feature.bottom_m, feature.top_m
    y, z, bar = -feature.wall_thickness_m / 2, (low + high) / 2, _CASEMENT_M
    inner = width - 2 * bar
    posts = [
        Box(Part.OTHER, (x, y, z), (bar, bar, high - low)) for x in ((bar - width) / 2, (width - bar) / 2)
    ]
    rails = [
        Box(Part.OTHER, (0.0, y, rail_z), (inner, bar, bar)) for rail_z in (low + bar / 2, high - bar / 2)
    ]
    pane = Box(Part.OTHER, (0.0, y, z), (inner, _PANE_M, high - low - 2 * bar), material="glass")
    return [*posts, *rails, pane]
