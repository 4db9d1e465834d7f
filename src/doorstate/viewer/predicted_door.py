# SPDX-License-Identifier: Apache-2.0
"""Predicted door as lines over a cloud: frame, leaf, hinge and opening angle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.inference.prediction import Prediction

DOOR_HEIGHT_M = 2.0  # of the drawing; no head predicts it
_ARC_STEPS = 16
_ARC_SHARE = 0.55  # radius of the arc, of the width of the leaf


class Line(NamedTuple):
    """Line over a cloud."""

    name: str
    points_m: NDArray[np.float64]  # (K, 3) sensor frame
    label: str = ""  # at its end


def predicted_door(prediction: Prediction, floor_z_m: float) -> list[Line]:
    """Return the lines of a predicted door, those that follow from its heads.

    The leaf is drawn on the robot's side of the wall, because no head predicts to which side it swings.

    Args:
        prediction: a prediction; without a frame and a width there is nothing to draw.
        floor_z_m: height of the floor in the sensor frame.
    """
    opening, width_m = prediction.opening, prediction.opening_width_m
    if prediction.frame is None or opening is None or not width_m:
        return []
    left, right = np.array(opening.left_m), np.array(opening.right_m)
    along = (left - right) / width_m  # along the wall, to its left
    door = [Line("door frame", _upright(left, right, floor_z_m))]
    if prediction.hinge is None:
        return door
    hinge, shut = (left, -along) if prediction.hinge == "left" else (right, along)
    axis = Line("hinge", _upright(hinge, hinge, floor_z_m)[:2])
    if prediction.opening_angle_deg is None:
        return [*door, axis]
    towards_robot = np.array([-along[1], along[0]])
    angles = np.radians(np.linspace(0.0, prediction.opening_angle_deg, _ARC_STEPS))
    directions = np.outer(np.cos(angles), shut) + np.outer(np.sin(angles), towards_robot)
    leaf = _upright(hinge, hinge + width_m * directions[-1], floor_z_m)
    arc = hinge + _ARC_SHARE * width_m * directions
    label = f"{prediction.opening_angle_deg:.0f}°"
    return [
        *door,
        Line("leaf", np.concatenate([leaf, leaf[:1]])),
        Line("angle", np.column_stack([arc, np.full(_ARC_STEPS, floor_z_m)]), label),
        axis,
    ]


def _upright(start: NDArray[np.float64], end: NDArray[np.float64], floor_z_m: float) -> NDArray[np.float64]:
    """Return the (4, 3) corners of an upright rectangle on the floor, from start up, over and down to end."""
    heights = (floor_z_m, floor_z_m + DOOR_HEIGHT_M, floor_z_m + DOOR_HEIGHT_M, floor_z_m)
    return np.array([[*place, z] for place, z in zip((start, start, end, end), heights, strict=True)])
