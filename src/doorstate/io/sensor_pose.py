# SPDX-License-Identifier: Apache-2.0
"""Pose of a camera, and the transform of its points into the body frame.

The body frame is level, at the camera and along its view: x forward, y left, z up. Points in the frame of their camera
are turned to x forward, y left, z up by the names of their axes, then levelled by roll and pitch. Points in a map
frame (VIEWPOINT of PCD files) are moved to the camera and turned to its heading; the map must be level, with z up as in
ROS REP 105. A tilt that is given takes the place of the one in VIEWPOINT.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError
from doorstate.io.rotations import (
    Matrix,
    Quaternion,
    axes_matrix,
    heading_and_tilt_deg,
    heading_matrix,
    parse_axes,
    quaternion_matrix,
    rotate,
    tilt_matrix,
)
from doorstate.io.viewpoint import Viewpoint
from doorstate.types import Points

Origin = Literal["assumed", "given", "frame_id", "depth image", "VIEWPOINT", "accelerometer"]
"""Where a part of a pose comes from."""

_LYING_DEG = 60.0
_UPRIGHT = 0.7  # cosine of the angle between up in the frame of the camera and in the map


@dataclass(frozen=True)
class SensorPose:
    """Pose of a camera in the frame of its points.

    Attributes:
        rotation: R_body_stored, (3, 3), row by row.
        axes: directions of x, y, z in the frame of the camera (`rotations`).
        roll_deg, pitch_deg: tilt of the camera, clockwise from behind and down.
        position_m: of the camera in the frame of the points, in metres; zero for points in the frame of the camera.
        axes_from, tilt_from: where axes and tilt come from.
        camera_height_m: height of the camera above the floor, if it is known.
    """

    rotation: Matrix
    axes: str = "flu"
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes_from: Origin = "assumed"
    tilt_from: Origin = "assumed"
    camera_height_m: float | None = None

    @property
    def is_tilt_known(self) -> bool:
        """True if the points in the body frame are level, False if they are taken for level."""
        return self.tilt_from != "assumed"

    def to_body(self, points: NDArray[Any]) -> Points:
        """Return stored points (..., 3), in metres, in the body frame."""
        if any(self.position_m):
            with np.errstate(over="ignore", invalid="ignore"):
                points = points - np.array(self.position_m)
        with np.errstate(over="ignore", invalid="ignore"):  # overflow gives infinity, which is "not measured"
            return rotate(points, np.array(self.rotation)).astype(np.float32, copy=False)

    def from_body(self, points: NDArray[Any]) -> NDArray[np.float64]:
        """Return points (..., 3) of the body frame in the frame of the stored points, in metres."""
        stored: NDArray[np.float64] = rotate(points.astype(np.float64), np.array(self.rotation).T)
        stored = stored + np.array(self.position_m)
        return stored

    def to_dict(self) -> dict[str, Any]:
        """Return the pose as JSON values, without a position of zero and without a height that is not known."""
        values: dict[str, Any] = {
            "axes": self.axes,
            "axes_from": self.axes_from,
            "roll_deg": round(self.roll_deg, 3) + 0.0,  # no -0.0
            "pitch_deg": round(self.pitch_deg, 3) + 0.0,
            "tilt_from": self.tilt_from,
        }
        if any(self.position_m):
            values["position_m"] = [round(x, 4) for x in self.position_m]
        if self.camera_height_m is not None:
            values["camera_height_m"] = round(self.camera_height_m, 4)
        return values


class PosedCloud(NamedTuple):
    """Points in the body frame, and the pose that was applied to them."""

    points: Points  # (N, 3) or (H, W, 3) metres
    pose: SensorPose


def camera_pose(
    axes: str,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    axes_from: Origin = "given",
    tilt_from: Origin = "given",
) -> SensorPose:
    """Return the pose of a camera whose points are in its own frame.

    Args:
        axes: `ros`, `optical`, `opengl` or three letters (`rotations`).
        roll_deg, pitch_deg: tilt.
        axes_from, tilt_from: where they come from.

    Raises:
        CameraError: no such axes.
    """
    axes = parse_axes(axes)
    rotation = _product(tilt_matrix(roll_deg, pitch_deg), axes_matrix(axes))
    return SensorPose(rotation, axes, roll_deg, pitch_deg, axes_from=axes_from, tilt_from=tilt_from)


def pose_from_quaternion(axes: str, quaternion: Quaternion, axes_from: Origin) -> SensorPose:
    """Return the pose of a camera from its orientation R_level_camera in a level frame; its heading is left out.

    Raises:
        CameraError: not of length 1, or the camera looks straight up or down.
    """
    _, pitch_deg, roll_deg = _heading_and_tilt_deg(axes, axes_from, quaternion)
    return camera_pose(axes, roll_deg, pitch_deg, axes_from, "given")


def pose_in_map(pose: SensorPose, viewpoint: Viewpoint) -> SensorPose:
    """Return the pose of a camera whose points are in the frame of a map.

    Args:
        pose: axes and tilt of the camera; a tilt that is assumed is replaced by that of the viewpoint.
        viewpoint: pose in the frame of the map.

    Raises:
        CameraError: no rotation, or a camera that looks straight up or down in the map.
    """
    try:
        if pose.tilt_from != "assumed":
            map_from_sensor = np.array(quaternion_matrix(viewpoint.quaternion))
            rotation = _product(pose.rotation, map_from_sensor.T)
            return replace(pose, rotation=rotation, position_m=viewpoint.position)
        heading_deg, pitch_deg, roll_deg = _heading_and_tilt_deg(
            pose.axes, pose.axes_from, viewpoint.quaternion
        )
    except CameraError as error:
        raise CameraError(
            f"VIEWPOINT: {error.message}",
            expected=error.expected,
            suggestions=error.suggestions or {"ignore_viewpoint": True},
        ) from error
    return replace(
        pose,
        rotation=heading_matrix(-heading_deg),
        roll_deg=roll_deg,
        pitch_deg=pitch_deg,
        position_m=viewpoint.position,
        tilt_from="VIEWPOINT",
    )


def _heading_and_tilt_deg(axes: str, axes_from: Origin, quaternion: Quaternion) -> tuple[float, float, float]:
    level_from_stored = np.array(quaternion_matrix(quaternion))
    heading_deg, pitch_deg, roll_deg = heading_and_tilt_deg(level_from_stored @ np.array(axes_matrix(axes)).T)
    up_if_optical = float((level_from_stored @ np.array(axes_matrix("rdf")).T)[2, 2])
    if axes_from == "assumed" and abs(roll_deg) > _LYING_DEG and up_if_optical > _UPRIGHT:
        raise CameraError(
            f"with axes {axes} the camera lies on its side, with those of an optical frame it is upright",
            suggestions={"axes": "optical"},
        )
    return heading_deg, pitch_deg, roll_deg


def _product(left: Any, right: Any) -> Matrix:
    rows = (np.array(left) @ np.array(right)).tolist()
    return tuple(tuple(row) for row in rows)  # type: ignore[return-value]
