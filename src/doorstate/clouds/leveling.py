# SPDX-License-Identifier: Apache-2.0
"""Level clouds: points of a tilted camera turned so that z points up.

The tilt is the one the user knows, or the one the cloud shows. Level points are R_level_camera times the measured ones,
R_level_camera = R_y(pitch) R_x(roll) as in `io.rotations`; the heading of the camera stays zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.floor import find_floor_z_m
from doorstate.clouds.shape import check_shape
from doorstate.clouds.vertical import LevelingRefusal, find_vertical
from doorstate.clouds.view_planes import find_planes, sample_ahead
from doorstate.io.rotations import rotate, tilt_matrix
from doorstate.types import Points

LevelingSource = Literal["given", "floor", "walls", "doorways"]  # the last by `doorways.upright`


@dataclass(frozen=True, eq=False)
class Leveling:
    """Level cloud, and the tilt of its camera.

    Attributes:
        points: level points, in the shape of the cloud; the cloud itself where the tilt is refused, or given as zero.
        rotation: R_level_camera, (3, 3).
        source: where the tilt comes from, `floor` or `walls` if from the cloud; None where it is refused.
        error_deg: standard error of the tilt; None where it is given or refused.
        floor_z_m: height of the floor, negative; None where none is measured and no height of the camera is given.
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
        return -math.degrees(math.asin(min(1.0, max(-1.0, float(self.rotation[2, 0])))))

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

    Without a given tilt it is told from floor, ceiling and walls, for cameras that look at most 35 degrees up or down.
    A cloud that does not show it is refused: nothing flat, surfaces that all face one way, or two directions that are
    about as likely.

    Args:
        cloud: (N, 3) or organized (H, W, 3) metres, in the frame of the camera: origin at the camera, x forward,
            y left, z up; NaN where nothing was measured. Outliers (`clouds.outliers`) are best removed before.
        roll_deg, pitch_deg: tilt, if it is known; one of them alone leaves the other at zero. A tilt of zero changes
            no bit of the points.
        camera_height_m: height of the camera above the floor, if it is known: it tells the floor from other planes.

    Raises:
        CloudContentError: no numbers of such a shape.
    """
    cloud = check_shape(cloud)
    if roll_deg is not None or pitch_deg is not None:
        rotation = np.array(tilt_matrix(roll_deg or 0.0, pitch_deg or 0.0))
        points = rotate(cloud, rotation).astype(np.result_type(cloud, np.float32), copy=False)
        return Leveling(points, rotation, "given", floor_z_m=find_floor_z_m(points, camera_height_m))
    sample = sample_ahead(cloud)
    vertical = find_vertical(find_planes(sample), sample, camera_height_m)
    if isinstance(vertical, LevelingRefusal):
        return Leveling(cloud, np.eye(3), None, refusal=vertical)
    rotation = np.array(tilt_matrix(vertical.roll_deg, vertical.pitch_deg))
    with np.errstate(over="ignore", invalid="ignore"):  # infinity is "not measured", and may become NaN
        points = cloud @ rotation.T.astype(np.result_type(cloud, np.float32))
    return Leveling(
        points,
        rotation,
        "floor" if vertical.shows_floor else "walls",
        error_deg=vertical.error_deg,
        floor_z_m=find_floor_z_m(points, camera_height_m),
    )
