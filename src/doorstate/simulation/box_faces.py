# SPDX-License-Identifier: Apache-2.0
"""Faces of boxes that a camera can see, and the pixels of each as one span of columns in every row.

A ray `origin + t * direction` in a box's frame enters through the face of axis a at t = gap / towards, with `gap` the
distance of the camera from the face's plane and `towards` the direction's component against it. It does so inside the
face's four edges, each an inequality that is linear in the pixel's column and row. Arithmetic rounds, so each span
has a sure part, and pixels at its ends that only the slab test of the whole box decides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.scene.box import Box

_Floats = NDArray[np.float64]
_ROUNDING = 1e-12  # thousands of times the relative error of the terms of an edge
_LEVEL = 1e-30  # slope of an edge along a row, which must not be zero
_OTHER_AXES = np.array([[1, 2], [0, 2], [0, 1]])


class PlacedBoxes(NamedTuple):
    """Boxes (N,) as a camera sees them."""

    rotation: _Floats  # (N, 3, 3) R_box_camera
    origin: _Floats  # (N, 3) the camera in the box's frame
    half: _Floats  # (N, 3) half sizes


class Faces(NamedTuple):
    """Faces (F,) that the camera can see, by box and axis, with their pixels in each of the rows (H,) of the image."""

    box: NDArray[np.int64]  # (F,) number of the box
    axis: NDArray[np.int64]  # (F,) normal of the face in the box's frame
    offset_m: _Floats  # (F,) of the face's plane from the camera, along the axis
    sure: NDArray[np.int16]  # (F, 2, H) first and last column, plus one, of the pixels inside
    possible: NDArray[np.int16]  # (F, 2, H) of the pixels that may be inside
    rows: NDArray[np.int64]  # (F, 2) first and last row, plus one
    columns: NDArray[np.int64]  # (F, 2)


def place_boxes(boxes: Sequence[Box], pose: CameraPose) -> PlacedBoxes:
    """Return boxes in the frames that the slab test works in."""
    turns = np.zeros((len(boxes), 3, 3))
    # math, not numpy: libm gives the same bits on processors with different SIMD instructions.
    cos, sin = (np.array([turn(box.yaw_rad) for box in boxes]) for turn in (math.cos, math.sin))
    turns[:, 0, 0] = turns[:, 1, 1] = cos
    turns[:, 0, 1], turns[:, 1, 0], turns[:, 2, 2] = sin, -sin, 1.0
    centers = np.array([box.center_m for box in boxes]).reshape(-1, 3)
    offsets = np.array([pose.x_m, pose.y_m, pose.z_m]) - centers
    half = np.array([box.size_m for box in boxes]).reshape(-1, 3) / 2
    return PlacedBoxes(turns @ pose.rotation(), (turns @ offsets[..., None])[..., 0], half)


def visible_faces(placed: PlacedBoxes, numbers: Iterable[int], intrinsics: Intrinsics) -> Faces:
    """Return the faces of some boxes that have pixels, in the order of `numbers` and then of the axes."""
    order = np.array([*numbers], dtype=np.int64)
    outside = np.abs(placed.origin[order]) > placed.half[order]
    place, axis = np.nonzero(outside)
    box = order[place]
    origin, half = placed.origin[box, axis], placed.half[box, axis]
    offset_m = np.copysign(half, origin) - origin
    sure, possible = _spans(_edges(placed, box, axis, offset_m), intrinsics)
    filled = possible[:, 0] < possible[:, 1]
    kept = np.flatnonzero(filled.any(axis=1))
    filled, possible = filled[kept], possible[kept]
    last = filled.shape[1] - filled[:, ::-1].argmax(axis=1)
    first_column = np.where(filled, possible[:, 0], np.int16(2**15 - 1)).min(axis=1)
    last_column = np.where(filled, possible[:, 1], np.int16(0)).max(axis=1)
    return Faces(
        box[kept],
        axis[kept],
        offset_m[kept],
        sure[kept],
        possible,
        np.stack([filled.argmax(axis=1), last], axis=1),
        np.stack([first_column, last_column], axis=1).astype(np.int64),
    )


def _edges(
    placed: PlacedBoxes, box: NDArray[np.int64], axis: NDArray[np.int64], offset_m: _Floats
) -> _Floats:
    """Return the edges (F, 4, 3) of faces: a pixel is inside where (1, left, up) has a positive product with all."""
    gap, towards = np.abs(offset_m), np.copysign(1.0, offset_m)[:, None] * placed.rotation[box, axis]
    edges = []
    for number in range(2):
        other = _OTHER_AXES[axis, number]
        along = gap[:, None] * placed.rotation[box, other]
        origin, half = placed.origin[box, other], placed.half[box, other]
        edges += [(half + origin)[:, None] * towards + along, (half - origin)[:, None] * towards - along]
    return np.stack(edges, axis=1)


def _spans(edges: _Floats, intrinsics: Intrinsics) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
    """Return the sure and the possible columns (F, 2, H) between edges."""
    width, height = intrinsics.width, intrinsics.height
    corners = np.array([[0, 0], [width, height]]) - np.array([intrinsics.cx, intrinsics.cy])
    reach = np.abs(corners).max(axis=0) / (intrinsics.fx, intrinsics.fy)
    error = _ROUNDING * (np.abs(edges) @ np.array([1.0, *reach]))  # (F, 4)
    per_column, per_row = -edges[..., 1] / intrinsics.fx, -edges[..., 2] / intrinsics.fy
    constant = edges[..., 0] - per_column * intrinsics.cx - per_row * intrinsics.cy
    per_column = np.where(np.abs(per_column) < _LEVEL, _LEVEL, per_column)
    scale = (-1 / per_column)[..., None]
    crossing = np.multiply(per_row[..., None], np.arange(height, dtype=np.float64))
    crossing += constant[..., None]
    crossing *= scale  # (F, 4, H) column at which each row crosses the edge
    is_left = (per_column > 0)[..., None]
    margin = (error / np.abs(per_column))[..., None]
    spans = []
    for sign in (1, -1):
        first = (crossing + np.where(is_left, sign * margin, -np.inf)).max(axis=1)
        last = (crossing + np.where(is_left, np.inf, -sign * margin)).min(axis=1)
        first = np.clip(np.ceil(first, out=first), 0, width, out=first)
        last = np.clip(np.floor(last, out=last) + 1, 0, width)
        spans.append(np.stack([first, last], axis=1).astype(np.int16))
    return spans[0], spans[1]
