# SPDX-License-Identifier: Apache-2.0
"""Frames of a still camera in which no door moved, so that what is known of one holds for the next."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.stillness import Rays, changed_rays
from doorstate.doorways.doorway import Doorway
from doorstate.types import Points

# Chosen: a leaf of 0.9 m that turns by ten degrees changes about a third of its opening, people walk through a part.
_MOST_CHANGED, _MOST_CHANGED_AT_DOOR = 0.05, 0.1
_FEWEST_RAYS = 12
_DOOR_HEIGHT_M = 2.0


def is_still(
    before: Rays,
    after: Rays,
    doorways: Iterable[Doorway] = (),
    rotation: NDArray[np.float64] | None = None,
) -> bool:
    """Return True if hardly any ray changed, neither in the whole view nor in the openings of doors.

    Args:
        before, after: coarse views of two clouds as measured.
        doorways: doors in the level sensor frame.
        rotation: R_level_sensor (3, 3) of the clouds; None if they are level.
    """
    measured, changed = changed_rays(before, after)
    if measured.sum() < _FEWEST_RAYS or changed.sum() > _MOST_CHANGED * measured.sum():
        return False
    points = before.points_m if rotation is None else before.points_m @ rotation.T.astype(np.float32)
    for doorway in doorways:
        seen = measured & rays_through(doorway, points)
        if seen.sum() >= _FEWEST_RAYS and (changed & seen).sum() > _MOST_CHANGED_AT_DOOR * seen.sum():
            return False
    return True


def rays_through(doorway: Doorway, points: Points) -> NDArray[np.bool_]:
    """Return which rays (K,) to points (K, 3) of the level sensor frame pass an opening of two metres of height."""
    camera = doorway.to_doorway(np.zeros((1, 3), np.float32))
    directions = doorway.to_doorway(points) - camera
    with np.errstate(invalid="ignore", divide="ignore"):
        crossing = camera + directions * (-camera[0, 1] / directions[:, 1:2])
        through: NDArray[np.bool_] = (
            (directions[:, 1] < 0)
            & (np.abs(crossing[:, 0]) <= doorway.width_m / 2)
            & (crossing[:, 2] >= 0)
            & (crossing[:, 2] <= _DOOR_HEIGHT_M)
        )
    return through
