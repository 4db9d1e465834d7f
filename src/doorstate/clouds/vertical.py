# SPDX-License-Identifier: Apache-2.0
"""The vertical of a view: which of the directions that its planes allow is up.

In a room three directions at right angles agree with nearly all planes, and two of them may be within reach. The one
that looks most like a room (`up_evidence`) is taken if the others are unlikely beside it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from doorstate.clouds.up_directions import MAX_PITCH_DEG, SYSTEMATIC_DEG, face_one_way, up_directions
from doorstate.clouds.up_evidence import HEIGHT_TOLERANCE_M, WEIGHTS, evidence
from doorstate.clouds.view_planes import Floats, ViewPlane
from doorstate.types import Points

LevelingRefusalCode = Literal[
    "tilt_no_planes",  # hardly anything was measured, or hardly anything is flat
    "tilt_against_wall",
    "tilt_one_plane",  # a wall alone leaves the roll open, and a floor alone may be a wall
    "tilt_too_steep",
    "tilt_ambiguous",  # two directions are about as likely
    "tilt_upside_down",  # floor and ceiling could change places
    "tilt_unsure",
]

_MIN_PLANES_SHARE = 0.2  # of the cells; less is clutter or noise
_AGAINST_WALL_M = 0.5
_MAX_ERROR_DEG = 2.0
# By quarter turns of the roll: a camera is mounted upright unless the cloud says otherwise.
_PRIOR = (0.0, -1.75, -3.0, -1.75)
_MIN_PROBABILITY = (0.8, 0.8, 0.9, 0.8)
_SAME = math.cos(math.radians(10))
_EVIDENCE_POINTS = 1024


@dataclass(frozen=True)
class LevelingRefusal:
    """Reason why the tilt of a cloud cannot be told.

    Args:
        code: kind of the reason, for programs.
        values: measured values and their limits, by name.
    """

    code: LevelingRefusalCode
    values: Mapping[str, float] = field(default_factory=dict)


class Vertical(NamedTuple):
    """Direction up in the frame of the camera.

    Attributes:
        up: (3,) unit vector.
        error_deg: standard error.
        shows_floor: True if a horizontal plane below the camera is among its evidence.
    """

    up: Floats
    error_deg: float
    shows_floor: bool

    @property
    def pitch_deg(self) -> float:
        """Angle by which the camera looks down."""
        return -math.degrees(math.asin(min(1.0, max(-1.0, float(self.up[0])))))

    @property
    def roll_deg(self) -> float:
        """Clockwise rotation of the camera, seen from behind."""
        return math.degrees(math.atan2(self.up[1], self.up[2]))

    @property
    def quarter_turns(self) -> int:
        """Nearest number of clockwise quarter turns of the camera, 0 to 3."""
        return round(self.roll_deg / 90) % 4


def find_vertical(
    planes: Sequence[ViewPlane], sample: Points, camera_height_m: float | None = None
) -> Vertical | LevelingRefusal:
    """Return the vertical, or the reason why it cannot be told.

    Args:
        planes: planes of the view, largest first.
        sample: (M, 3) points of the view.
        camera_height_m: height of the camera above the floor, if it is known.
    """
    share = sum(plane.share for plane in planes)
    if share < _MIN_PLANES_SHARE:
        return LevelingRefusal("tilt_no_planes", {"share": share, "min_share": _MIN_PLANES_SHARE})
    if face_one_way(planes):
        return _of_one_plane(planes[0], sample, camera_height_m)
    verticals, scores = [], []
    for direction in up_directions(planes):
        heights_m = np.sort(sample[:: len(sample) // _EVIDENCE_POINTS + 1] @ direction.axis)
        for up, ascending_m in ((direction.axis, heights_m), (-direction.axis, -heights_m[::-1])):
            found = evidence(up, direction, planes, ascending_m, camera_height_m)
            vertical = Vertical(up, direction.error_deg, found["floor"] > 0)
            verticals.append(vertical)
            score = sum(WEIGHTS[name] * value for name, value in found.items())
            scores.append(score + _PRIOR[vertical.quarter_turns])
    if not verticals:
        return LevelingRefusal("tilt_too_steep", {"max_pitch_deg": MAX_PITCH_DEG})
    return _choose(verticals, np.array(scores))


def _of_one_plane(
    plane: ViewPlane, sample: Points, camera_height_m: float | None
) -> Vertical | LevelingRefusal:
    """Return the vertical of a floor at a known height, else the reason."""
    up = -plane.normal
    is_floor = abs(plane.distance_m - (camera_height_m or math.inf)) <= HEIGHT_TOLERANCE_M
    if is_floor and abs(up[0]) <= math.sin(math.radians(MAX_PITCH_DEG)):
        return Vertical(up, math.hypot(plane.error_deg, SYSTEMATIC_DEG), True)
    ahead_m = float(np.median(sample[:, 0]))
    if ahead_m < _AGAINST_WALL_M:
        return LevelingRefusal("tilt_against_wall", {"ahead_m": ahead_m})
    return LevelingRefusal("tilt_one_plane", {"distance_m": plane.distance_m, "share": plane.share})


def _choose(verticals: Sequence[Vertical], scores: Floats) -> Vertical | LevelingRefusal:
    """Return the vertical with the highest score, or the reason if it is too unlikely or inexact."""
    likelihoods = np.exp(scores - scores.max())
    best = verticals[int(scores.argmax())]
    cosines = np.array([vertical.up @ best.up for vertical in verticals])
    probability = float(likelihoods[cosines > _SAME].sum() / likelihoods.sum())
    if probability < _MIN_PROBABILITY[best.quarter_turns]:
        other = verticals[int(np.where(cosines > _SAME, -np.inf, scores).argmax())]
        return LevelingRefusal(
            "tilt_upside_down" if other.up @ best.up < -_SAME else "tilt_ambiguous",
            {
                "probability": probability,
                "min_probability": _MIN_PROBABILITY[best.quarter_turns],
                "pitch_deg": best.pitch_deg,
                "roll_deg": best.roll_deg,
                "error_deg": best.error_deg,
                "other_pitch_deg": other.pitch_deg,
                "other_roll_deg": other.roll_deg,
                "other_error_deg": other.error_deg,
            },
        )
    if best.error_deg > _MAX_ERROR_DEG:
        return LevelingRefusal("tilt_unsure", {"error_deg": best.error_deg, "max_error_deg": _MAX_ERROR_DEG})
    return best
