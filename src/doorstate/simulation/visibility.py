# SPDX-License-Identifier: Apache-2.0
"""Pixels that see a door's opening, and images that look the same."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_coordinates
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.frames import level
from doorstate.simulation.render import Render
from doorstate.simulation.scene.scene import Scene, door_frames
from doorstate.simulation.true_door import VisiblePixels
from doorstate.types import DepthImage, Part

SAME_IMAGE_M = 1e-4


def same_image(depth_m: DepthImage, reference_m: DepthImage) -> bool:
    """Return True if two depth images agree to 0.1 mm and are NaN in the same pixels."""
    measured = ~np.isnan(depth_m)
    return bool(
        np.array_equal(measured, ~np.isnan(reference_m))
        and np.abs(depth_m[measured] - reference_m[measured]).max(initial=0.0) <= SAME_IMAGE_M
    )


def opening_depth_m(pose: CameraPose, intrinsics: Intrinsics, width_m: float, height_m: float) -> DepthImage:
    """Return the z-depth at which rays cross an opening, a rectangle on the robot's wall face.

    Args:
        pose: camera in the door frame.
        intrinsics: pinhole model of the camera.
        width_m: width of the opening.
        height_m: height of the opening.

    Returns:
        (H, W) float32 metres, NaN for rays that miss the opening.
    """
    # The point of a pixel at unit depth, in the gravity-aligned sensor frame, is the ray's direction.
    unit = np.ones((intrinsics.height, intrinsics.width), np.float32)
    ray = level(np.moveaxis(depth_coordinates(unit, intrinsics), 0, -1), pose.pitch_rad, pose.roll_rad)
    ray_y = math.sin(pose.yaw_rad) * ray[..., 0] + math.cos(pose.yaw_rad) * ray[..., 1]
    ray_x = math.cos(pose.yaw_rad) * ray[..., 0] - math.sin(pose.yaw_rad) * ray[..., 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = -pose.y_m / ray_y
        inside = np.abs(pose.x_m + reach * ray_x) < width_m / 2
        z = pose.z_m + reach * ray[..., 2]
        inside &= (reach > 0) & (z > 0) & (z < height_m)
    return np.where(inside, reach, np.float32(np.nan))


def opening_depths_m(scene: Scene, pose: CameraPose, intrinsics: Intrinsics) -> list[DepthImage]:
    """Return `opening_depth_m` of each door of a scene, first the main door; none without a door."""
    if scene.door is None:
        return []
    doors = [scene.door, *(placed.door for placed in scene.other_doors or ())]
    return [
        opening_depth_m(pose.seen_from(frame), intrinsics, door.opening_width_m, door.opening_height_m)
        for door, frame in zip(doors, door_frames(scene), strict=True)
    ]


def count_visible(full: Render, cut: Render, numbers: range, opening_m: DepthImage) -> VisiblePixels:
    """Count the pixels of a door.

    Args:
        full: rendering before noise and range.
        cut: rendering as the camera reports it.
        numbers: numbers of the door's boxes.
        opening_m: `opening_depth_m` of the door.
    """
    own = (cut.box >= numbers.start) & (cut.box < numbers.stop)
    return VisiblePixels(
        leaf=int(np.count_nonzero(own & (cut.part == Part.LEAF))),
        frame=int(np.count_nonzero(own & (cut.part == Part.FRAME))),
        opening=int(np.count_nonzero(looks_into(full.depth_m, opening_m))),
    )


def looks_into(depth_m: DepthImage, opening_m: DepthImage) -> NDArray[np.bool_]:
    """Return the mask (H, W) of pixels whose ray crosses an opening and hits nothing in front of it.

    Args:
        depth_m: (H, W) depth before the camera's range is cut.
        opening_m: result of `opening_depth_m`.
    """
    mask: NDArray[np.bool_] = depth_m >= opening_m - SAME_IMAGE_M
    return mask
