# SPDX-License-Identifier: Apache-2.0
"""Walls without a door: plain, with a corner, cupboard, window, niche or passage (rules in docs/data-card.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

from pydantic import Field

from doorstate._models import FrozenModel, Metres
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.cupboard import cupboard_boxes
from doorstate.simulation.scene.wall import Gap, wall_boxes
from doorstate.simulation.scene.window import sash_boxes
from doorstate.types import Part

FeatureKind = Literal["wall", "inner_corner", "outer_corner", "cupboard", "window", "niche", "passage"]
FEATURES: tuple[FeatureKind, ...] = get_args(FeatureKind)

_LONG_M = 6.0
_BACK_M = 0.1


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


def feature_boxes(
    feature: Feature, gaps: Sequence[Gap] = (), ends_m: tuple[float, float] | None = None
) -> list[Box]:
    """Return the wall and the object in or before it, in the door frame; a plain wall may have gaps and ends."""
    match feature.kind:
        case "inner_corner" | "outer_corner":
            return _corner(feature)
        case "cupboard":
            cupboard = cupboard_boxes(feature.width_m, feature.depth_m, feature.top_m, feature.fronts)
            return [*_pierced(feature, feature.wall_thickness_m, 0.0), *cupboard]
        case "window":
            y = -feature.wall_thickness_m / 2
            sash = sash_boxes(feature.width_m, feature.bottom_m, feature.top_m, y)
            return [*_pierced(feature, feature.wall_thickness_m, feature.width_m), *sash]
        case "wall" if ends_m:
            return wall_boxes(ends_m, feature.wall_thickness_m, feature.wall_height_m, gaps)
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
