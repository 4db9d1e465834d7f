# SPDX-License-Identifier: Apache-2.0
"""Camera of a depth image: a pinhole, and the distortion of its lens if the image is not rectified."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.distortion import Distortion
from doorstate.io.size_limits import MAX_POINTS

MAX_SIDE_PX = 1 << 15  # of an image


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole intrinsics in pixels; pixel (0, 0) has its centre at (0, 0).

    Args:
        width, height: size of the image.
        fx, fy: focal lengths.
        cx, cy: centre of projection.
        distortion: of the lens; None for rectified images.

    Raises:
        CameraError: a size or focal length is not positive, or a number is not finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: Distortion | None = None

    def __post_init__(self) -> None:
        if not 1 <= min(self.width, self.height) <= max(self.width, self.height) <= MAX_SIDE_PX:
            raise CameraError("the image size is impossible", expected=f"1 to {MAX_SIDE_PX} pixels a side")
        if self.width * self.height > MAX_POINTS:
            raise CameraError(
                f"an image size of {self.width} x {self.height} is impossible",
                expected=f"at most {MAX_POINTS} pixels in all",
            )
        for name in ("fx", "fy", "cx", "cy"):
            value = getattr(self, name)
            if not math.isfinite(value) or (name in ("fx", "fy") and value <= 0):
                raise CameraError(f"{value} pixels is impossible: was the camera calibrated?", field=name)

    @classmethod
    def from_hfov(cls, width: int, height: int, hfov_rad: float) -> Self:
        """Return the ideal camera of a horizontal field of view: square pixels, centre in the middle.

        Source: gazebo_ros_pkgs, camera plugins: f = W / (2 tan(hfov / 2)), centre ((W - 1) / 2, (H - 1) / 2).
        """
        if not 0 < hfov_rad < math.pi:
            raise CameraError(f"{hfov_rad} rad is impossible", field="hfov_rad", expected="between 0 and pi")
        focal = width / (2 * math.tan(hfov_rad / 2))
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    def turned_clockwise(self) -> Intrinsics:
        """Return the intrinsics of the image rotated clockwise by 90 degrees: (u, v) goes to (height - 1 - v, u).

        Raises:
            CameraError: the image is distorted.
        """
        if self.distortion is not None:
            raise CameraError("a distorted image cannot be turned", expected="a rectified image")
        return Intrinsics(self.height, self.width, self.fy, self.fx, self.height - 1 - self.cy, self.cx)

    def rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the slopes to the left and up of the ray of each pixel, which broadcast to (height, width).

        NaN where no ray reaches a pixel through the lens.
        """
        if self.distortion is not None:
            return _undistorted_rays(self)
        left = (self.cx - np.arange(self.width, dtype=np.float64)) / self.fx  # (W,)
        up = (self.cy - np.arange(self.height, dtype=np.float64)) / self.fy  # (H,)
        return left, up[:, None]

    def check_image_size(self, width: int, height: int) -> None:
        """Check that an image has the size of the camera.

        Raises:
            CameraError: it has another size.
        """
        if (width, height) != (self.width, self.height):
            raise CameraError(
                f"the image has {width} x {height} pixels, the intrinsics are for {self.width} x {self.height}",
                field="intrinsics",
                expected="those of this image size",
            )


@lru_cache(maxsize=4)
def _undistorted_rays(camera: Intrinsics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    assert camera.distortion is not None
    left, up = replace(camera, distortion=None).rays()
    slopes = -camera.distortion.undo(-np.stack(np.broadcast_arrays(left, up), axis=-1))
    slopes.flags.writeable = False
    return slopes[..., 0], slopes[..., 1]


class Pinhole(NamedTuple):
    """Intrinsics in pixels, for images of any size."""

    fx: float
    fy: float
    cx: float
    cy: float


def pinhole_from_numbers(
    fx: float | None, fy: float | None, cx: float | None, cy: float | None
) -> Pinhole | None:
    """Return the camera of four numbers in pixels, or None if all of them are None.

    Raises:
        CameraError: only some of them are given.
    """
    numbers = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    missing = [name for name, number in numbers.items() if number is None]
    if len(missing) == len(numbers):
        return None
    if fx is None or fy is None or cx is None or cy is None:
        raise CameraError("is missing", field=missing[0], expected="all four of fx, fy, cx and cy, or none")
    return Pinhole(fx, fy, cx, cy)
