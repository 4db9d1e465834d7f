# SPDX-License-Identifier: Apache-2.0
"""Plain twin of the renderer: a slab test (Kay & Kajiya 1986) of every box in every pixel, with the same arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.scene.box import Box


class PlainRender(NamedTuple):
    depth_m: np.ndarray  # (H, W) float32, inf where nothing is hit
    box: np.ndarray  # (H, W) -1 where nothing is hit
    incidence_rad: np.ndarray  # (H, W) float32, 0 where nothing is hit


def plain_render(
    boxes: Sequence[Box], pose: CameraPose, camera: Intrinsics, numbers: Sequence[int] | None = None
) -> PlainRender:
    """Render some of the boxes; of two surfaces at the same depth the earlier box wins."""
    left = -(np.arange(camera.width)[None, :] - camera.cx) / camera.fx
    up = -(np.arange(camera.height)[:, None] - camera.cy) / camera.fy
    depth = np.full((camera.height, camera.width), np.inf)
    index, cosine = np.full(depth.shape, -1), np.ones(depth.shape)
    for number in range(len(boxes)) if numbers is None else numbers:
        slabs = list(_slabs(boxes[number], pose, left, up))
        enter = np.maximum.reduce([near for near, _, _ in slabs])
        leave = np.minimum.reduce([far for _, far, _ in slabs])
        hit = (enter >= 0.01) & (enter <= leave) & (enter < depth)
        depth[hit], index[hit] = enter[hit], number
        for near, _, direction in slabs:
            face = hit & (near == enter)
            cosine[face] = np.abs(direction)[face]
    length = np.where(index == -1, 1.0, np.sqrt(1 + left * left + up * up))
    return PlainRender(depth.astype(np.float32), index, np.arccos(cosine / length).astype(np.float32))


def _slabs(
    box: Box, pose: CameraPose, left: np.ndarray, up: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield z-depth at the near and the far plane of each axis, and the ray's direction along it."""
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation, origin = turn @ pose.rotation(), turn @ (np.array(pose[:3]) - np.array(box.center_m))
    for axis in range(3):
        forward, to_left, to_up = rotation[axis]
        direction = np.broadcast_to(forward + to_left * left + to_up * up, (len(up), left.shape[1]))
        half = box.size_m[axis] / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (-half - origin[axis]) / direction, (half - origin[axis]) / direction
        yield np.minimum(low, high), np.maximum(low, high), direction
