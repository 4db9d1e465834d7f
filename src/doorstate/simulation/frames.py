# SPDX-License-Identifier: Apache-2.0
"""From what a manifest row says to its frame, bit for bit."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.simulation.noise.models import apply, find_sensor
from doorstate.simulation.noise.streams import sample_seed
from doorstate.simulation.scene import Box
from doorstate.simulation.sensor import CameraPose, DepthCamera, Render, cut_range, render_behind_glass
from doorstate.types import DepthImage, Part, Points

SAME_IMAGE_M = 1e-4


class Sample(Protocol):
    """A row that can be replayed."""

    @property
    def sample_id(self) -> str:
        """Its name."""

    @property
    def state(self) -> str:
        """Its label."""

    @property
    def seed(self) -> int:
        """What everything random in it depends on."""

    @property
    def sensor(self) -> str:
        """What measures: a name for `noise.models.find_sensor`."""

    @property
    def camera(self) -> DepthCamera:
        """The camera."""

    def camera_pose(self) -> CameraPose:
        """Where it is, in the door frame."""

    def boxes(self) -> list[Box]:
        """What it looks at."""

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """The row with other values."""


AnyRow = TypeVar("AnyRow", bound=Sample)


class Frame(NamedTuple):
    """A replayed sample."""

    full: Render  # before sensor and range: what a colour camera would see
    cut: Render  # what the depth camera reports
    points: Points  # (H, W, 3) metres, gravity-aligned sensor frame


def replay(row: Sample) -> Frame:
    """Rebuild the frame of a manifest row, bit for bit."""
    pose, intrinsics = row.camera_pose(), row.camera.intrinsics()
    boxes, sensor = row.boxes(), find_sensor(row.sensor)
    full = render_behind_glass(boxes, pose, intrinsics)
    cut = apply(sensor, full, boxes, pose, row.camera, sample_seed(row.seed, row.sample_id))
    points = depth_to_points(cut.depth_m, intrinsics)
    return Frame(full, cut, level(points, pose.pitch_rad, pose.roll_rad))


def sensed_by(row: AnyRow, sensor: str) -> AnyRow:
    """The row as this sensor sees it, with the sensor's own camera if that is not the usual one.

    Raises:
        ConfigError: no such sensor.
    """
    camera = find_sensor(sensor).camera
    return row.model_copy(update={"sensor": sensor} | ({} if camera == DepthCamera() else {"camera": camera}))


def simulate(
    rows: Sequence[AnyRow], sensor: str, opening_size_m: tuple[float, float] | None
) -> tuple[list[AnyRow], list[Frame]]:
    """Render samples that differ in how far the door is open alone, and fill in what can be seen of it.

    Args:
        rows: drawn and not yet rendered.
        sensor: what measures.
        opening_size_m: width and height; None without a door.

    Raises:
        ConfigError: no such sensor.
    """
    rows = [sensed_by(row, sensor) for row in rows]
    frames = [replay(row) for row in rows]
    opening_m = None
    if opening_size_m is not None:
        opening_m = opening_depth_m(rows[0].camera_pose(), rows[0].camera.intrinsics(), *opening_size_m)
    # Two states that are the same but for a sensor's noise are still the same.
    clean = [cut_range(frame.full, row.camera).depth_m for row, frame in zip(rows, frames, strict=True)]
    filled = []
    for row, frame, depth_m in zip(rows, frames, clean, strict=True):
        twins = [
            other.state
            for other, other_m in zip(rows, clean, strict=True)
            if other.state != row.state and same_image(depth_m, other_m)
        ]
        seen: dict[str, object] = {
            "measured_px": int((frame.cut.part != Part.NONE).sum()),
            "same_image_as": " ".join(dict.fromkeys(twins)),
            "depth_sha256": depth_sha256(frame),
        }
        if opening_m is not None:
            seen |= {
                "visible_leaf_px": int((frame.cut.part == Part.LEAF).sum()),
                "visible_frame_px": int((frame.cut.part == Part.FRAME).sum()),
                "visible_opening_px": int(looks_into(frame.full.depth_m, opening_m).sum()),
            }
        filled.append(row.model_copy(update=seen))
    return filled, frames


def depth_sha256(frame: Frame) -> str:
    """Of the depth image, so that a row can tell whether it renders as it did."""
    return hashlib.sha256(frame.cut.depth_m.tobytes()).hexdigest()


def door_place(x_m: float, y_m: float, z_m: float, heading_rad: float) -> dict[str, Any]:
    """The door frame in the sensor frame, as columns of a manifest.

    Args:
        x_m: of the camera in the door frame.
        y_m: likewise.
        z_m: likewise.
        heading_rad: where the camera looks, in the door frame.
    """
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    # The camera's own frame has the door at R(-heading) (door - camera).
    return {
        "door_x_m": -x_m * cos - y_m * sin,
        "door_y_m": x_m * sin - y_m * cos,
        "door_z_m": -z_m,
        "door_yaw_deg": math.degrees(math.remainder(-heading_rad, 2 * math.pi)),
    }


def level(points: Points, pitch_rad: float, roll_rad: float = 0.0) -> Points:
    """Turn points of a tilted camera back to a level sensor frame.

    Args:
        points: (..., 3) metres.
        pitch_rad: positive looks down.
        roll_rad: positive turns the camera clockwise, as seen from behind it.
    """
    if roll_rad:
        cos, sin = math.cos(roll_rad), math.sin(roll_rad)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        points = np.stack([x, cos * y - sin * z, sin * y + cos * z], axis=-1).astype(np.float32)
    if not pitch_rad:
        return points
    cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1).astype(np.float32)


def same_image(one: DepthImage, other: DepthImage) -> bool:
    """Whether two depth images are equal to 0.1 mm, and NaN in the same pixels."""
    measured = ~np.isnan(one)
    return bool(
        np.array_equal(measured, ~np.isnan(other))
        and np.abs(one[measured] - other[measured]).max(initial=0.0) <= SAME_IMAGE_M
    )


def opening_depth_m(pose: CameraPose, intrinsics: Intrinsics, width_m: float, height_m: float) -> DepthImage:
    """Z-depth at which rays meet an opening, which is a rectangle on the robot's wall face.

    Args:
        pose: the camera in the door frame.
        intrinsics: of the camera.
        width_m: of the opening.
        height_m: of the opening.

    Returns:
        (H, W) float32 metres, NaN for rays that do not meet it.
    """
    # A unit-depth point per pixel, in the gravity-aligned sensor frame, is the ray's direction.
    unit = np.ones((intrinsics.height, intrinsics.width), np.float32)
    ray = level(depth_to_points(unit, intrinsics), pose.pitch_rad, pose.roll_rad)
    ray_y = math.sin(pose.yaw_rad) * ray[..., 0] + math.cos(pose.yaw_rad) * ray[..., 1]
    ray_x = math.cos(pose.yaw_rad) * ray[..., 0] - math.sin(pose.yaw_rad) * ray[..., 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = -pose.y_m / ray_y
        inside = np.abs(pose.x_m + reach * ray_x) < width_m / 2
        z = pose.z_m + reach * ray[..., 2]
        inside &= (reach > 0) & (z > 0) & (z < height_m)
    return np.where(inside, reach, np.float32(np.nan))


def looks_into(depth_m: DepthImage, opening_m: DepthImage) -> NDArray[np.bool_]:
    """Pixels (H, W) of an uncut depth image that meet an opening, and nothing before it."""
    met: NDArray[np.bool_] = depth_m >= opening_m - SAME_IMAGE_M
    return met
