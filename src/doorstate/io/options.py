# SPDX-License-Identifier: Apache-2.0
"""Reading options: what files and messages leave open, and their user has to state."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from doorstate.errors import CameraError, unknown_name
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.rotations import Quaternion, parse_axes, quaternion_matrix
from doorstate.io.sensor_pose import Origin, SensorPose, camera_pose, pose_from_quaternion
from doorstate.types import UNITS_M

AUTO = "auto"
MAX_CAMERA_HEIGHT_M = 2.5  # of a robot, or in a raised hand


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """Axes, tilt, units and camera of a file or message.

    Args:
        axes: axes of clouds: `ros` (x forward, y left, z up), `optical` (x right, y down, z forward), `opengl` (x
            right, y up, z back), or the directions of x, y and z as three letters among forward, back, left, right, up,
            down, such as `flu`. `auto` is `optical` if the header of a message names such a frame, else `ros`. Depth
            images are always optical.
        roll_deg: clockwise rotation of the camera, seen from behind: 90 for a camera on its right side.
        pitch_deg: angle by which the camera looks down; negative if it looks up. One of the two alone leaves the other
            at zero. Without both, and without a quaternion, the tilt is not known: methods that can tell it from the
            cloud do, others take the camera for level.
        quaternion: x, y, z, w of the rotation from the frame of the points to a level frame (x forward, y left, z up),
            in place of roll and pitch; its heading is left out.
        camera_height_m: height of the camera above the floor, if it is known.
        ignore_viewpoint: read points of PCD files as points in the frame of the camera, whatever VIEWPOINT says.
        intrinsics: camera of depth images; a `Pinhole` fits every image size.
        rectified: True if depth images of a topic are rectified, False if not; None for what its name tells
            (`calibration`).
        depth_scale_m: metres per unit of integer depth images.
        units_m: metres per unit of clouds and of floating point depth images (metres by ROS REP 118).

    Raises:
        CameraError: an impossible value.
    """

    axes: str = AUTO
    roll_deg: float | None = None
    pitch_deg: float | None = None
    quaternion: Quaternion | None = None
    camera_height_m: float | None = None
    ignore_viewpoint: bool = False
    intrinsics: Intrinsics | Pinhole | None = None
    rectified: bool | None = None
    depth_scale_m: float = 0.001
    units_m: float = 1.0

    def __post_init__(self) -> None:
        for field in ("depth_scale_m", "units_m"):
            scale_m = getattr(self, field)
            if not (math.isfinite(scale_m) and scale_m > 0):
                raise CameraError(
                    f"{scale_m} metres per unit is impossible", field=field, expected="a positive number"
                )
        for field, limit_deg in (("roll_deg", 360), ("pitch_deg", 90)):
            if not abs(getattr(self, field) or 0.0) <= limit_deg:  # also for NaN
                raise CameraError(
                    f"{getattr(self, field)} degrees is impossible",
                    field=field,
                    expected=f"{-limit_deg} to {limit_deg}",
                )
        if self.camera_height_m is not None and not 0 < self.camera_height_m <= MAX_CAMERA_HEIGHT_M:
            raise CameraError(
                f"a camera {self.camera_height_m} m above the floor is impossible",
                field="camera_height_m",
                expected=f"more than 0, at most {MAX_CAMERA_HEIGHT_M:g}",
            )
        if self.quaternion is not None and (self.roll_deg or self.pitch_deg):
            raise CameraError("is given with a roll or pitch", field="quaternion", expected="one of them")
        if self.quaternion is not None:
            quaternion_matrix(self.quaternion)
        if self.axes.lower() != AUTO:
            parse_axes(self.axes)
        if isinstance(self.intrinsics, Pinhole):
            Intrinsics(1, 1, *self.intrinsics)  # checks the four numbers
        elif not isinstance(self.intrinsics, Intrinsics | None):
            raise CameraError(
                f"{self.intrinsics!r} is not a camera", field="intrinsics", expected="Intrinsics or Pinhole"
            )

    def pose(self, frame_id: str = "", *, is_depth: bool = False) -> SensorPose:
        """Return the pose of the camera, for points in its own frame.

        Args:
            frame_id: frame in the header of a message.
            is_depth: True for depth images.
        """
        axes, axes_from = self._axes(frame_id, is_depth)
        if self.quaternion is not None:
            pose = pose_from_quaternion(axes, self.quaternion, axes_from)
        else:
            is_given = self.roll_deg is not None or self.pitch_deg is not None
            pose = camera_pose(
                axes,
                self.roll_deg or 0.0,
                self.pitch_deg or 0.0,
                axes_from,
                "given" if is_given else "assumed",
            )
        return replace(pose, camera_height_m=self.camera_height_m)

    def _axes(self, frame_id: str, is_depth: bool) -> tuple[str, Origin]:
        if is_depth:
            return "rdf", "depth image"
        if self.axes.lower() != AUTO:
            return parse_axes(self.axes), "given"
        return ("rdf", "frame_id") if is_optical(frame_id) else ("flu", "assumed")


DEFAULT_OPTIONS = ReadOptions()


def is_optical(frame_id: str) -> bool:
    """Return True if the name of a frame is that of an optical frame (REP 103): x right, y down, z forward."""
    return "optical" in frame_id


def unit_name(units_m: float) -> str:
    """Return the name of a unit of `UNITS_M`, or the number itself for any other unit."""
    return next((name for name, metres in UNITS_M.items() if metres == units_m), f"{units_m:g}")


def metres_per_unit(name: str) -> float:
    """Return the size of a unit of `UNITS_M`.

    Raises:
        ConfigError: no such unit.
    """
    if name not in UNITS_M:
        raise unknown_name("unit", name, UNITS_M, field="units")
    return UNITS_M[name]
