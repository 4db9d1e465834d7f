# SPDX-License-Identifier: Apache-2.0
"""Doorways of a cloud that may be tilted. They stand upright, which tells a tilt that floor and walls leave open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from doorstate.clouds.leveling import Leveling, level_cloud
from doorstate.doorways.doorway import Doorway
from doorstate.doorways.finder import find_doorways
from doorstate.types import Points

# A wall that lies on its side shows no likely doorway: in 530 views of cameras that were level, tilted or on their
# side, these limits accepted no wrong tilt (paper/log.md).
_MIN_SCORE = 0.7
_MAX_OTHER = 0.5  # score of the other direction, in parts of the better one's


class Upright(NamedTuple):
    """Level cloud, and the candidate doorways in it; none where the tilt is refused."""

    leveling: Leveling
    doorways: list[Doorway]


def find_upright_doorways(
    cloud: Points, *, is_level: bool = False, camera_height_m: float | None = None
) -> Upright:
    """Level a cloud and find its doorways, which decide where floor and walls leave two directions open.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, in the frame of the camera, without outliers.
        is_level: z of the cloud points up; False tells the tilt from the cloud.
        camera_height_m: height of the camera above the floor, if it is known.
    """
    tilt_deg = 0.0 if is_level else None
    leveling = level_cloud(cloud, roll_deg=tilt_deg, pitch_deg=tilt_deg, camera_height_m=camera_height_m)
    if leveling.refusal is None:
        return Upright(leveling, find_doorways(leveling.points, leveling.floor_z_m))
    values = leveling.refusal.values
    if "other_pitch_deg" not in values:
        return Upright(leveling, [])
    turned = [_turned(cloud, values, prefix, camera_height_m) for prefix in ("", "other_")]
    other, better = sorted(turned, key=_score)
    is_clear = _score(better) >= _MIN_SCORE and _score(other) <= _MAX_OTHER * _score(better)
    return better if is_clear else Upright(leveling, [])


def _turned(
    cloud: Points, values: Mapping[str, float], prefix: str, camera_height_m: float | None
) -> Upright:
    leveling = level_cloud(
        cloud,
        roll_deg=values[f"{prefix}roll_deg"],
        pitch_deg=values[f"{prefix}pitch_deg"],
        camera_height_m=camera_height_m,
    )
    leveling = replace(leveling, source="doorways", error_deg=values[f"{prefix}error_deg"])
    return Upright(leveling, find_doorways(leveling.points, leveling.floor_z_m))


def _score(upright: Upright) -> float:
    return max((doorway.score for doorway in upright.doorways), default=0.0)
