# SPDX-License-Identifier: Apache-2.0
"""Depth cameras and their poses."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from doorstate._models import Degrees, FrozenModel
from doorstate.io.camera import MAX_SIDE_PX, Intrinsics
from doorstate.io.size_limits import MAX_POINTS
from doorstate.simulation.scene.box import Pose

MAX_RANGE_M = 1000.0


class DepthCamera(FrozenModel):
    """A pinhole depth camera; the defaults are the ASUS Xtion Pro as Gazebo's `openni_kinect` plugin simulates it.

    Image 640 x 480, 60 degrees, valid strictly between 0.4 and 5.0 m. Pixels are square; the centre of projection is
    the image's unless `cx_px` and `cy_px` are set.
    """

    width: int = Field(default=640, ge=1, le=MAX_SIDE_PX)
    height: int = Field(default=480, ge=1, le=MAX_SIDE_PX)
    hfov_deg: float = Field(default=60.0, ge=1, lt=180)
    min_depth_m: float = Field(default=0.4, ge=0, le=MAX_RANGE_M)
    max_depth_m: float = Field(default=5.0, gt=0, le=MAX_RANGE_M)
    cx_px: float | None = Field(default=None, ge=-MAX_SIDE_PX, le=2 * MAX_SIDE_PX)
    cy_px: float | None = Field(default=None, ge=-MAX_SIDE_PX, le=2 * MAX_SIDE_PX)

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        if self.width * self.height > MAX_POINTS:
            raise ValueError(
                f"an image of {self.width} x {self.height} pixels: expected at most {MAX_POINTS} in all"
            )
        return self

    def intrinsics(self) -> Intrinsics:
        """Return the pinhole model of Gazebo: f = W / (2 tan(hfov / 2)), centre ((W - 1) / 2, (H - 1) / 2)."""
        ideal = Intrinsics.from_hfov(self.width, self.height, math.radians(self.hfov_deg))
        return replace(
            ideal,
            cx=ideal.cx if self.cx_px is None else self.cx_px,
            cy=ideal.cy if self.cy_px is None else self.cy_px,
        )


CAMERAS = {
    "xtion-gazebo": DepthCamera(),
    "xtion-hw": DepthCamera(hfov_deg=58.0, min_depth_m=0.8, max_depth_m=3.5),
}


class CameraBias(FrozenModel):
    """Constant errors of a camera: what it tells of itself less what is true, and the factor of its depths."""

    pitch_deg: Degrees = 0.0
    roll_deg: Degrees = 0.0
    depth_factor: float = Field(default=1.0, gt=0.5, lt=2)


class CameraPose(NamedTuple):
    """A camera pose in the door frame; yaw about z, pitch about y, then roll about x, as in SDF.

    Positive pitch looks down, positive roll turns the camera clockwise as seen from behind it.
    """

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @classmethod
    def from_degrees(
        cls, position_m: tuple[float, float, float], yaw_deg: float, pitch_deg: float, roll_deg: float = 0.0
    ) -> Self:
        """Return a pose from angles in degrees."""
        return cls(*position_m, math.radians(yaw_deg), math.radians(pitch_deg), math.radians(roll_deg))

    def seen_from(self, frame: Pose) -> CameraPose:
        """Return the pose in a frame whose own pose in the door frame is given."""
        x_m, y_m, yaw_rad = frame.inverse().after(Pose(self.x_m, self.y_m, self.yaw_rad))
        return self._replace(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)

    def rotation(self) -> NDArray[np.float64]:
        """Return R_door_camera, (3, 3); camera axes x forward, y left, z up."""
        # math, not numpy: libm gives the same bits on processors with different SIMD instructions.
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cos_pitch, sin_pitch = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        unrolled = np.array(
            [
                [cos_yaw * cos_pitch, -sin_yaw, cos_yaw * sin_pitch],
                [sin_yaw * cos_pitch, cos_yaw, sin_yaw * sin_pitch],
                [-sin_pitch, 0.0, cos_pitch],
            ]
        )
        if not self.roll_rad:
            return unrolled
        cos_roll, sin_roll = math.cos(self.roll_rad), math.sin(self.roll_rad)
        left, up = unrolled[:, 1], unrolled[:, 2]
        return np.stack(
            [unrolled[:, 0], cos_roll * left + sin_roll * up, cos_roll * up - sin_roll * left], axis=1
        )
