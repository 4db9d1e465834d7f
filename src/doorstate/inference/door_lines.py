# SPDX-License-Identifier: Apache-2.0
"""Doors as lines over a cloud: frame, leaf at its angle, swing and hinge; refused candidates as frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction

DOOR_FRAME = "door frame"  # name of the first line of each door
DOOR_HEIGHT_M = 2.0  # of the drawing; no head predicts it
_REFUSED_HEIGHT_M = 1.0  # lower than doors, so that both can be told apart where they overlap
SWING_DEG = 90.0  # a leaf is drawn with the way that it takes to be open
_STEPS = 16
_ANGLE_SHARE = 0.55  # radius of the arc of the angle, of the width of the leaf

Place = NDArray[np.float64]


class Line(NamedTuple):
    """Line over a cloud."""

    name: str
    points_m: NDArray[np.float64]  # (K, 3) level sensor frame
    label: str = ""  # at its end


class LeafPlan(NamedTuple):
    """Hinge and directions of a leaf in plan view.

    It turns to the robot's side of the wall, because no head predicts to which side it swings.
    """

    hinge_m: NDArray[np.float64]  # (2,)
    shut: NDArray[np.float64]  # (2,) unit vector from the hinge along the shut leaf
    towards: NDArray[np.float64]  # (2,) unit vector of a leaf at 90 degrees

    @classmethod
    def of(cls, door: Door) -> LeafPlan | None:
        """Return the leaf of a door; None without a hinge."""
        if door.hinge is None:
            return None
        left, right = (np.array(end) for end in door.opening)
        along = (left - right) / door.width_m  # along the wall, to its left
        hinge, shut = (left, -along) if door.hinge == "left" else (right, along)
        return cls(hinge, shut, np.array([-along[1], along[0]]))

    def at(self, radius_m: float, angle_deg: float) -> NDArray[np.float64]:
        """Return the place (2,) on the leaf, so far from the hinge, at an opening angle."""
        angle = math.radians(angle_deg)
        place: NDArray[np.float64] = self.hinge_m + radius_m * (
            math.cos(angle) * self.shut + math.sin(angle) * self.towards
        )
        return place


def door_lines(
    prediction: Prediction, floor_z_m: float, *, refused: bool = False, names: Sequence[str] = ()
) -> list[Line]:
    """Return the lines of all doors of a prediction; labels name them, or number them where there are several.

    Args:
        prediction: a prediction; without doors there is nothing to draw.
        floor_z_m: height of the floor in the level sensor frame, for doors without their own.
        refused: draw candidates that are no doors as well, with their reasons.
        names: name of each door; without names there are numbers.
    """
    several = len(prediction.doors) > 1
    labels = names or (range(1, len(prediction.doors) + 1) if several else ())
    lines = []
    for label, door in zip_longest(labels, prediction.doors):
        text = "" if label is None else f"{label}: {door.label.replace('_', '-')}"
        lines += _lines(door, floor_z_m, text)
    for door in prediction.refused if refused else ():
        lines.append(Line("refused", _frame(door, floor_z_m, _REFUSED_HEIGHT_M), _short_reason(door)))
    return lines


def _lines(door: Door, floor_z_m: float, label: str) -> list[Line]:
    """Return the lines of one door, those that follow from its values."""
    frame = Line(DOOR_FRAME, _frame(door, floor_z_m, DOOR_HEIGHT_M), label)
    leaf_plan = LeafPlan.of(door)
    if leaf_plan is None:
        return [frame]
    hinge = leaf_plan.hinge_m
    floor_m = _floor_m(door, floor_z_m)
    axis = Line("hinge", _upright(hinge, hinge, floor_m, DOOR_HEIGHT_M)[:2])
    if door.opening_angle_deg is None:
        return [frame, axis]

    def arc(radius_m: float, angle_deg: float) -> Place:
        """Return the (K, 3) places of an arc on the floor, from the shut leaf on."""
        places = [leaf_plan.at(radius_m, angle) for angle in np.linspace(0.0, angle_deg, _STEPS)]
        return np.column_stack([places, np.full(_STEPS, floor_m)])

    tip = leaf_plan.at(door.width_m, door.opening_angle_deg)
    leaf = _upright(hinge, tip, floor_m, DOOR_HEIGHT_M)
    angle = f"{door.opening_angle_deg:.0f}°"
    return [
        frame,
        Line("leaf", np.concatenate([leaf, leaf[:1]])),
        Line("angle", arc(_ANGLE_SHARE * door.width_m, door.opening_angle_deg), angle),
        Line("swing", arc(door.width_m, max(SWING_DEG, door.opening_angle_deg))),
        axis,
    ]


def _frame(door: Door, floor_z_m: float, height_m: float) -> Place:
    """Return the (5, 3) corners of a door frame, from the upper right one around."""
    left, right = (np.array(end) for end in door.opening)
    corners = _upright(left, right, _floor_m(door, floor_z_m), height_m)
    return corners[[2, 3, 0, 1, 2]]


def _floor_m(door: Door, floor_z_m: float) -> float:
    return floor_z_m if door.floor_z_m is None else door.floor_z_m


def _short_reason(door: Door) -> str:
    """Return the code of the reason in words, and the probability of a door where the network was asked."""
    words = "" if door.abstention is None else door.abstention.code.replace("_", " ")
    return words if door.door_probability is None else f"{words} ({door.door_probability:.2f})"


def _upright(start: Place, end: Place, floor_m: float, height_m: float) -> Place:
    """Return the (4, 3) corners of an upright rectangle, from the foot of start up, over and down to end."""
    heights = (floor_m, floor_m + height_m, floor_m + height_m, floor_m)
    return np.array([[*place, z] for place, z in zip((start, start, end, end), heights, strict=True)])
