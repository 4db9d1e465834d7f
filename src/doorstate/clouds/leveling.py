# SPDX-License-Identifier: Apache-2.0
"""Level clouds: points of a tilted camera turned so that z points up.

The tilt is the one the user knows, or the one the cloud shows. Level points are R_level_camera times the measured ones,
R_level_camera = R_y(pitch) R_x(roll) as in `io.rotations`; the heading of the camera stays zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.floor import find_floor_z_m
from doorstate.clouds.shape import check_shape
from doorstate.io.rotations import rotate, tilt_matrix
from doorstate.types import Points

LevelingSource = Literal["given", "floor", "walls"]
LevelingRefusalCode = Literal["no_surfaces"]


@dataclass(frozen=True)
class LevelingRefusal:
    """Reason why the tilt of a cloud cannot be told.

    Args:
        code: kind of the reason, for programs.
        values: measured values and their limits, by name.
    """

    code: LevelingRefusalCode
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Leveling:
    """Level cloud, and the tilt of its camera.

    Attributes:
        points: level points, in the shape of the cloud; the cloud itself where the tilt is refused or zero.
        rotation: R_level_camera, (3, 3).
        source: where the tilt comes from; None where it is refused.
        error_deg: standard error of the tilt; None where it is given or refused.
        floor_z_m: height of the floor below the camera, negative; None where none is measured and no height is given.
        refusal: reason why the tilt cannot be told; None where it is known.
    """

    points: Points
    rotation: NDArray[np.float64]
    source: LevelingSource | None
    error_deg: float | None = None
    floor_z_m: float | None = None
    refusal: LevelingRefusal | None = None

    @property
    def pitch_deg(self) -> float:
        """Angle by which the camera looks down."""
        return math.degrees(-math.asin(min(1.0, max(-1.0, float(self.rotation[2, 0])))))

    @property
    def roll_deg(self) -> float:
        """Clockwise rotation of the camera, seen from behind."""
        return math.degrees(math.atan2(self.rotation[2, 1], self.rotation[2, 2]))


def level_cloud(
    cloud: Points,
    *,
    roll_deg: float | None = None,
    pitch_deg: float | None = None,
    camera_height_m: float | None = None,
) -> Leveling:
    """Return a cloud turned level, with its floor.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, camera at the origin, x forward, y left, z up before the camera was
            tilted; NaN where nothing was measured.
        roll_deg, pitch_deg: tilt, if the user knows it; one of them alone leaves the other at zero. Points of a camera
            whose tilt is zero stay as they are, bit for bit.
        camera_height_m: height of the camera above the floor, if it is known.

    Raises:
        CloudContentError: no numbers of such a shape.
    """
    cloud = check_shape(cloud)
    if roll_deg is None and pitch_deg is None:
        return Leveling(cloud, np.eye(3), None, refusal=LevelingRefusal("no_surfaces"))
    rotation = np.array(tilt_matrix(roll_deg or 0.0, pitch_deg or 0.0))
    points = rotate(cloud, rotation).astype(cloud.dtype, copy=False)
    return Leveling(points, rotation, "given", floor_z_m=find_floor_z_m(points, camera_height_m))
