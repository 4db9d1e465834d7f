# SPDX-License-Identifier: Apache-2.0
"""Prediction for one labelled door of a frame that may show several."""

from __future__ import annotations

from collections.abc import Sequence

from doorstate.doorways.doorway import Doorway, gap
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction

# Chosen: a label and a door of a network err by a decimetre each; neighbouring doors are a width apart.
_SAME_M, _SAME_DEG = 0.5, 30.0


def prediction_at(prediction: Prediction, doorway: Doorway | None) -> Prediction:
    """Return the prediction with the door at a place as its only one.

    A method that finds no doors answers for the frame as a whole, and its prediction is returned as it is; so is one
    that abstained from the whole frame.

    Args:
        prediction: prediction for a frame.
        doorway: place of the door; None asks for the frame.
    """
    finds_doors = bool(prediction.doors or prediction.refused)
    if doorway is None or not finds_doors:
        return prediction
    door, refused = _nearest(prediction.doors, doorway), _nearest(prediction.refused, doorway)
    return Prediction.from_doors(
        [] if door is None else [door],
        [] if refused is None else [refused],
        prediction.num_points,
        prediction.milliseconds,
        prediction.tilt,
    )


def _nearest(doors: Sequence[Door], doorway: Doorway) -> Door | None:
    """Return the nearest of the doors at a place."""
    gaps = [(*gap(door, doorway), number) for number, door in enumerate(doors)]
    near = [
        (gap_m, number)
        for gap_m, turn_deg, number in gaps
        if gap_m <= _SAME_M and min(turn_deg, 180 - turn_deg) <= _SAME_DEG
    ]
    return doors[min(near)[1]] if near else None
