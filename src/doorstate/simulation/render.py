# SPDX-License-Identifier: Apache-2.0
"""Depth images of boxes by an exact slab test (Kay & Kajiya 1986), each box only over its own pixels.

A ray is `origin + t * direction` with the direction scaled so that t is z-depth, as a depth camera reports it. Along
each axis of a box the direction is linear in the pixel's column and row; for a level camera it depends on one of the
two only, and NumPy's broadcasting then keeps that axis one-dimensional.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.scene.box import Box, Material
from doorstate.types import DepthImage, Part

NO_BOX = -1
_NEAR_M = 0.01  # corners closer than this cannot be projected
_ROUNDING = 1e-9
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_EDGES = np.array(
    [(a, b) for a in range(8) for b in range(a) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 2]
)


class Render(NamedTuple):
    """Depth, part and box of every pixel."""

    depth_m: DepthImage  # (H, W) z-depth, inf where nothing is hit
    part: NDArray[np.uint8]  # (H, W) doorstate.types.Part, NONE where nothing is hit
    box: NDArray[np.int16]  # (H, W) index of the box, NO_BOX where nothing is hit


def render(boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics) -> Render:
    """Cast one ray per pixel against all boxes; of two surfaces at the same depth the earlier box wins.

    Returns:
        Depth (H, W) float32 in metres, part (H, W) uint8 and box (H, W) int16.
    """
    return _render(boxes, range(len(boxes)), pose, intrinsics)


def render_behind_glass(boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics) -> Render:
    """Cast rays as `render` does, without boxes of glass: the opaque surface behind each pane."""
    opaque = [number for number, box in enumerate(boxes) if box.material != "glass"]
    return _render(boxes, opaque, pose, intrinsics)


def incidence(
    rendered: Render, boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics
) -> NDArray[np.float32]:
    """Return the angle between each pixel's ray and the normal of the face it hits, exact from the box.

    Args:
        rendered: result of `render` or `render_behind_glass` for the same boxes, before or after `cut_range`.
        boxes: scene in the door frame.
        pose: camera in the door frame.
        intrinsics: pinhole model of the camera.

    Returns:
        (H, W) float32 radians in [0, pi / 2]; 0 where nothing is hit.
    """
    cosine = np.ones(rendered.box.shape)
    for number in np.unique(rendered.box[rendered.box != NO_BOX]).tolist():
        window = _window(boxes[number], pose, intrinsics)
        visible = rendered.box[window.rows, window.columns] == number
        slabs = list(_slabs(window, intrinsics))
        enter = np.maximum(np.maximum(slabs[0][0], slabs[1][0]), slabs[2][0])
        for near, _, direction in slabs:
            # The face is the one through which the ray enters last.
            hit = visible & (near == enter)
            np.copyto(cosine[window.rows, window.columns], np.abs(direction), where=hit)
    left = (np.arange(intrinsics.width) - intrinsics.cx)[None, :] / intrinsics.fx
    up = (np.arange(intrinsics.height) - intrinsics.cy)[:, None] / intrinsics.fy
    length = np.where(rendered.box == NO_BOX, 1.0, np.sqrt(1 + left * left + up * up))
    return np.arccos(cosine / length).astype(np.float32)


def is_made_of(material: Material, rendered: Render, boxes: Sequence[Box]) -> NDArray[np.bool_]:
    """Return the mask (H, W) of pixels that see a box of this material."""
    # NO_BOX is -1 and so indexes the last entry.
    return np.array([*(box.material == material for box in boxes), False])[rendered.box]


def cut_range(rendered: Render, camera: DepthCamera) -> Render:
    """Set depth to NaN, part to NONE and box to NO_BOX unless min < depth < max, strictly, as in the Gazebo plugin."""
    with np.errstate(invalid="ignore"):
        valid = (rendered.depth_m > camera.min_depth_m) & (rendered.depth_m < camera.max_depth_m)
    return keep(rendered, valid)


def keep(rendered: Render, valid: NDArray[np.bool_]) -> Render:
    """Set depth to NaN, part to NONE and box to NO_BOX where the mask (H, W) is False."""
    lost = ~valid
    # Part.NONE and NO_BOX have all bits set; a bitwise or is several times faster than np.where.
    return Render(
        np.where(valid, rendered.depth_m, np.float32(np.nan)),
        rendered.part | -lost.view(np.uint8),
        rendered.box | -lost.astype(np.int16),
    )


class _Window(NamedTuple):
    """The pixels that can see a box, and the box in the camera's frame."""

    rotation: NDArray[np.float64]  # R_box_camera
    origin: NDArray[np.float64]  # the camera in the box's frame
    half: NDArray[np.float64]
    rows: slice
    columns: slice
    nearest_m: float  # z-depth of the box's nearest point


def _window(box: Box, pose: CameraPose, intrinsics: Intrinsics) -> _Window:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    rotation_box_door = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation = rotation_box_door @ pose.rotation()
    offset = np.array([pose.x_m, pose.y_m, pose.z_m]) - np.array(box.center_m)
    origin = rotation_box_door @ offset
    half = np.array(box.size_m) / 2
    return _Window(rotation, origin, half, *_pixel_window(rotation, origin, half, intrinsics))


def _render(boxes: Sequence[Box], numbers: Sequence[int], pose: CameraPose, intrinsics: Intrinsics) -> Render:
    shape = (intrinsics.height, intrinsics.width)
    depth = np.full(shape, np.inf)
    index = np.full(shape, NO_BOX, dtype=np.int16)
    for number in numbers:
        window = _unhidden(_window(boxes[number], pose, intrinsics), depth)
        if window.rows.start < window.rows.stop and window.columns.start < window.columns.stop:
            _cast_box(number, window, intrinsics, depth, index)
    parts = np.array([*(box.part for box in boxes), Part.NONE], dtype=np.uint8)
    return Render(depth.astype(np.float32), parts[index], index)


def _unhidden(window: _Window, depth: NDArray[np.float64]) -> _Window:
    """Return the window without the outer rows and columns where all pixels already hit something nearer."""
    farther = depth[window.rows, window.columns] > window.nearest_m * (1 - _ROUNDING)
    rows, columns = np.flatnonzero(farther.any(axis=1)), np.flatnonzero(farther.any(axis=0))
    if not len(rows):
        return window._replace(rows=slice(0, 0))
    return window._replace(
        rows=slice(window.rows.start + int(rows[0]), window.rows.start + int(rows[-1]) + 1),
        columns=slice(window.columns.start + int(columns[0]), window.columns.start + int(columns[-1]) + 1),
    )


def _cast_box(
    number: int,
    window: _Window,
    intrinsics: Intrinsics,
    depth: NDArray[np.float64],
    index: NDArray[np.int16],
) -> None:
    enter: NDArray[np.float64] = np.full((1, 1), _NEAR_M)
    leave: NDArray[np.float64] = np.full((1, 1), np.inf)
    # Level axes first: they stay one-dimensional until the last.
    for near, far, _ in _slabs(window, intrinsics):
        enter = np.maximum(enter, near)
        leave = np.minimum(leave, far)
    before = depth[window.rows, window.columns]
    hit = (enter <= leave) & (enter < before)
    # A camera inside a box would hit it at the near limit; no scene has such a camera.
    np.copyto(before, enter, where=hit)
    np.copyto(index[window.rows, window.columns], np.int16(number), where=hit)


def _slabs(
    window: _Window, intrinsics: Intrinsics
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Yield, for each axis of the box, z-depth at the near and the far plane and the ray's direction along the axis."""
    columns = np.arange(window.columns.start, window.columns.stop)[None, :]
    rows = np.arange(window.rows.start, window.rows.stop)[:, None]
    left = -(columns - intrinsics.cx) / intrinsics.fx  # (1, w)
    up = -(rows - intrinsics.cy) / intrinsics.fy  # (h, 1)
    for axis in range(3):
        direction = _direction(window.rotation[axis], left, up)
        # A ray along a face divides by zero: +-inf is the right value, and 0/0 (on the face) counts as a miss.
        with np.errstate(divide="ignore", invalid="ignore"):
            low = (-window.half[axis] - window.origin[axis]) / direction
            high = (window.half[axis] - window.origin[axis]) / direction
        yield np.minimum(low, high), np.maximum(low, high, out=high), direction


def _direction(
    row: NDArray[np.float64], left: NDArray[np.float64], up: NDArray[np.float64]
) -> NDArray[np.float64]:
    direction = np.full((1, 1), row[0])
    if row[1]:
        direction = direction + row[1] * left
    if row[2]:
        direction = direction + row[2] * up
    return direction


def _pixel_window(
    rotation: NDArray[np.float64],
    origin: NDArray[np.float64],
    half: NDArray[np.float64],
    intrinsics: Intrinsics,
) -> tuple[slice, slice, float]:
    """Return rows and columns that can see the box, and the z-depth of its nearest point."""
    corners = (_CORNERS * half - origin) @ rotation  # (8, 3) in the camera's frame
    ahead = corners[:, 0] >= _NEAR_M
    if not ahead.any():
        return slice(0, 0), slice(0, 0), math.inf
    if not ahead.all():
        # Clip the box at the near plane: keep the corners ahead of it, and add those of the edges that cross it.
        crossing = _EDGES[ahead[_EDGES[:, 0]] != ahead[_EDGES[:, 1]]]
        start, end = corners[crossing[:, 0]], corners[crossing[:, 1]]
        share = (_NEAR_M - start[:, :1]) / (end[:, :1] - start[:, :1])
        corners = np.concatenate([corners[ahead], start + share * (end - start)])
    forward = np.maximum(corners[:, 0], _NEAR_M)
    u = intrinsics.cx - corners[:, 1] / forward * intrinsics.fx
    v = intrinsics.cy - corners[:, 2] / forward * intrinsics.fy
    return _clip(v, intrinsics.height), _clip(u, intrinsics.width), float(forward.min())


def _clip(pixels: NDArray[np.float64], size: int) -> slice:
    start = min(max(math.floor(pixels.min()), 0), size)
    return slice(start, max(min(math.ceil(pixels.max()) + 1, size), start))
