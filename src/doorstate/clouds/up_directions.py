# SPDX-License-Identifier: Apache-2.0
"""Directions that may be up: normals of horizontal planes, and lines in which upright planes meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.view_planes import Floats, ViewPlane

MAX_PITCH_DEG = 38.0  # 35, and the error of the estimate
_MIN_MEETING = math.sin(math.radians(20))  # of planes that fix the line in which they meet
_SAME = math.cos(math.radians(6))  # of two directions
_TOLERANCE_DEG, _MAX_NOISE_DEG = 3.0, 6.0  # of a level or upright plane
_MIN_AGREEMENT = 0.5  # of the planes' shares, relative to the best direction
SYSTEMATIC_DEG = 0.4  # error of the normal of a large plane: bent lenses, floors and walls
_SMALL_SHARE = 0.1  # smaller planes bend more
_REFITS = 2


class UpDirection(NamedTuple):
    """Axis that may be the vertical; which end is up is open.

    Attributes:
        axis: (3,) unit vector in the frame of the camera.
        error_deg: standard error.
        is_level: mask (P,) of the planes across the axis.
        is_upright: mask (P,) of the planes along the axis.
    """

    axis: Floats
    error_deg: float
    is_level: NDArray[np.bool_]
    is_upright: NDArray[np.bool_]


def up_directions(planes: Sequence[ViewPlane]) -> list[UpDirection]:
    """Return the axes within the largest pitch, those that most of the planes agree with first."""
    fit = _Fit(planes)
    axes = _axes(fit.normals)
    axes = axes[_in_reach(axes)]
    if len(axes) == 0:
        return []
    is_level, is_upright = fit.agreeing(axes)
    agreement = (is_level | is_upright) @ fit.shares
    found: list[UpDirection] = []
    taken = agreement < _MIN_AGREEMENT * agreement.max()
    for number in np.argsort(-agreement, kind="stable"):
        if taken[number]:
            continue
        taken |= np.abs(axes @ axes[number]) > _SAME
        direction = fit.refine(axes[number])
        if _in_reach(direction.axis) and all(abs(other.axis @ direction.axis) < _SAME for other in found):
            found.append(direction)
    return found


class _Fit:
    def __init__(self, planes: Sequence[ViewPlane]) -> None:
        self.normals = np.array([plane.normal for plane in planes])
        self.shares = np.array([plane.share for plane in planes])
        noise_deg = np.array([plane.error_deg for plane in planes])
        self._tolerance = np.radians(_TOLERANCE_DEG + np.minimum(2 * noise_deg, _MAX_NOISE_DEG))
        variance_deg2 = noise_deg**2 + SYSTEMATIC_DEG**2 * (1 + _SMALL_SHARE / self.shares)
        self._weights = 1 / np.radians(np.sqrt(variance_deg2)) ** 2

    def agreeing(self, axes: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return masks (..., P) of the planes across and along axes (..., 3)."""
        cosines = np.abs(axes @ self.normals.T)
        return cosines > np.cos(self._tolerance), cosines < np.sin(self._tolerance)

    def refine(self, axis: Floats) -> UpDirection:
        """Return the least-squares axis of the planes that agree with an axis."""
        for _ in range(_REFITS):
            is_level, is_upright = self.agreeing(axis)
            level, upright = (self._scatter(mask) for mask in (is_level, is_upright))
            values, vectors = np.linalg.eigh(upright + np.trace(level) * np.eye(3) - level)
            axis = vectors[:, 0]
        equations = 2 * np.count_nonzero(is_level) + np.count_nonzero(is_upright)
        # Planes that agree worse than their errors allow are as uncertain as they disagree.
        misfit = max(1.0, values[0] / max(1, equations - 2))
        variance = misfit * (1 / max(values[1], 1e-9) + 1 / max(values[2], 1e-9))
        return UpDirection(axis, math.degrees(math.sqrt(variance)), is_level, is_upright)

    def _scatter(self, mask: NDArray[np.bool_]) -> Floats:
        normals = self.normals[mask]
        scatter: Floats = (normals * self._weights[mask, None]).T @ normals
        return scatter


def _axes(normals: Floats) -> Floats:
    """Return the normals of planes, and the lines in which two of them meet."""
    first, second = np.tril_indices(len(normals), -1)
    lines = np.cross(normals[first], normals[second])
    lengths = np.sqrt([line @ line for line in lines])  # to the bit those of np.linalg.norm of each line
    meet = np.flatnonzero(lengths > _MIN_MEETING)
    return np.concatenate([normals, lines[meet] / lengths[meet, None]])


def _in_reach(axes: Floats) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.abs(axes[..., 0]) <= math.sin(math.radians(MAX_PITCH_DEG))
    return inside


def face_one_way(planes: Sequence[ViewPlane]) -> bool:
    """Return True if no two planes differ enough to tell the vertical."""
    normals = np.array([plane.normal for plane in planes])
    return bool((np.abs(normals @ normals.T) > math.sqrt(1 - _MIN_MEETING**2)).all())
