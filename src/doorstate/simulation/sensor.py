# SPDX-License-Identifier: Apache-2.0
"""A depth camera that looks at boxes: exact slab test (Kay & Kajiya 1986), each box only over its own pixels.

A ray is `origin + t * direction` with the direction scaled so that t is z-depth, as a depth camera reports it. Along
each axis of a box the direction is linear in the pixel's column and row; for a level camera it depends on one of the
two only, and NumPy's broadcasting then keeps that axis one-dimensional.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import SerializerFunctionWrapHandler, model_serializer

from doorstate._models import FrozenModel
from doorstate.io.camera import Intrinsics
from doorstate.simulation.scene import Box, Material
from doorstate.types import DepthImage, Part

NO_BOX = -1
_NEAR_M = 0.01  # corners closer than this cannot be projected
_ROUNDING = 1e-9
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
_EDGES = np.array(
    [(a, b) for a in range(8) for b in range(a) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 2]
)


class DepthCamera(FrozenModel):
    """A pinhole depth camera; the defaults are the ASUS Xtion Pro as Gazebo's `openni_kinect` plugin simulates it.

    Image 640x480, 60 degrees, valid strictly between 0.4 and 5.0 m (SIMULATION section 1.2). Pixels are square; the
    centre of projection is the image's, unless it is given.
    """

    width: int = 640
    height: int = 480
    hfov_deg: float = 60.0
    min_depth_m: float = 0.4
    max_depth_m: float = 5.0
    cx_px: float | None = None
    cy_px: float | None = None

    def intrinsics(self) -> Intrinsics:
        """The pinhole of Gazebo: f = W / (2 tan(hfov / 2)), centre ((W - 1) / 2, (H - 1) / 2)."""
        ideal = Intrinsics.from_hfov(self.width, self.height, math.radians(self.hfov_deg))
        return replace(
            ideal,
            cx=ideal.cx if self.cx_px is None else self.cx_px,
            cy=ideal.cy if self.cy_px is None else self.cy_px,
        )

    @model_serializer(mode="wrap")
    def _omit_defaults(self, fields: SerializerFunctionWrapHandler) -> dict[str, float]:
        # Manifests have no columns for what ordinary cameras do not have.
        return {name: value for name, value in fields(self).items() if value is not None}


CAMERAS = {
    "xtion-gazebo": DepthCamera(),
    "xtion-hw": DepthCamera(hfov_deg=58.0, min_depth_m=0.8, max_depth_m=3.5),
}


class CameraPose(NamedTuple):
    """Where the camera is in the door frame; yaw about z, pitch about y, then roll about x, as in SDF.

    Positive pitch looks down, positive roll turns the camera clockwise as seen from behind it.
    """

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    pitch_rad: float = 0.0
    roll_rad: float = 0.0

    @classmethod
    def of_degrees(
        cls, at_m: tuple[float, float, float], yaw: float, pitch: float, roll: float = 0.0
    ) -> Self:
        """A pose with its angles in degrees."""
        return cls(*at_m, math.radians(yaw), math.radians(pitch), math.radians(roll))

    def rotation(self) -> NDArray[np.float64]:
        """R_door_camera, (3, 3); camera axes x forward, y left, z up."""
        # math, not numpy: libm gives the same bits whatever SIMD the processor has.
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


class Render(NamedTuple):
    """What the camera sees before its range is cut."""

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
    """As `render`, with all glass taken out: the opaque surface that a pixel would see through it."""
    opaque = [number for number, box in enumerate(boxes) if box.material != "glass"]
    return _render(boxes, opaque, pose, intrinsics)


def incidence(
    rendered: Render, boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics
) -> NDArray[np.float32]:
    """Angle between each pixel's ray and the normal of the face it hits, exact from the box.

    Args:
        rendered: what `render` or `render_behind_glass` saw of the same boxes, cut or not.
        boxes: the scene, in the door frame.
        pose: of the camera, in the door frame.
        intrinsics: of the camera.

    Returns:
        (H, W) float32 radians in [0, pi / 2]; 0 where nothing is hit.
    """
    cosine = np.ones(rendered.box.shape)
    for number in np.unique(rendered.box[rendered.box != NO_BOX]).tolist():
        window = _window(boxes[number], pose, intrinsics)
        seen = rendered.box[window.rows, window.columns] == number
        slabs = list(_slabs(window, intrinsics))
        enter = np.maximum(np.maximum(slabs[0][0], slabs[1][0]), slabs[2][0])
        for near, _, direction in slabs:
            # The face is the one through which the ray enters last.
            hit = seen & (near == enter)
            np.copyto(cosine[window.rows, window.columns], np.abs(direction), where=hit)
    left = (np.arange(intrinsics.width) - intrinsics.cx)[None, :] / intrinsics.fx
    up = (np.arange(intrinsics.height) - intrinsics.cy)[:, None] / intrinsics.fy
    length = np.where(rendered.box == NO_BOX, 1.0, np.sqrt(1 + left * left + up * up))
    return np.arccos(cosine / length).astype(np.float32)


def is_made_of(material: Material, rendered: Render, boxes: Sequence[Box]) -> NDArray[np.bool_]:
    """Pixels (H, W) that see a box of this material."""
    # The last entry is that of NO_BOX, which indexes from the end.
    return np.array([*(box.material == material for box in boxes), False])[rendered.box]


def cut_range(rendered: Render, camera: DepthCamera) -> Render:
    """Depth is NaN, part NONE and box NO_BOX unless min < depth < max, both strict, as in the Gazebo plugin."""
    with np.errstate(invalid="ignore"):
        valid = (rendered.depth_m > camera.min_depth_m) & (rendered.depth_m < camera.max_depth_m)
    return keep(rendered, valid)


def keep(rendered: Render, valid: NDArray[np.bool_]) -> Render:
    """Depth is NaN, part NONE and box NO_BOX where (H, W) is not valid."""
    lost = ~valid
    # All bits set is Part.NONE as well as NO_BOX; a bitwise or is several times quicker than np.where.
    return Render(
        np.where(valid, rendered.depth_m, np.float32(np.nan)),
        rendered.part | -lost.view(np.uint8),
        rendered.box | -lost.astype(np.int16),
    )


class _Window(NamedTuple):
    """A box in the camera's frame, and the pixels that can see it."""

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
    """The window without the rows and columns at its sides where everything is nearer than the box."""
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
    # A camera inside a box would enter at the near limit; our rooms have none.
    np.copyto(before, enter, where=hit)
    np.copyto(index[window.rows, window.columns], np.int16(number), where=hit)


def _slabs(
    window: _Window, intrinsics: Intrinsics
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """For each axis of the box: z-depth at the nearer and the farther plane, and the ray's direction along it."""
    left = (
        -(np.arange(window.columns.start, window.columns.stop) - intrinsics.cx)[None, :] / intrinsics.fx
    )  # (1, w)
    up = -(np.arange(window.rows.start, window.rows.stop) - intrinsics.cy)[:, None] / intrinsics.fy  # (h, 1)
    for axis in range(3):
        direction = _direction(window.rotation[axis], left, up)
        # A ray along a face divides by zero: +-inf is the right answer, and 0/0 (on the face) counts as a miss.
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (-window.half[axis] - window.origin[axis]) / direction
            other = (window.half[axis] - window.origin[axis]) / direction
        yield np.minimum(one, other), np.maximum(one, other, out=other), direction


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
    """Rows and columns that can see the box, and the depth of its nearest point."""
    corners = (_CORNERS * half - origin) @ rotation  # (8, 3) in the camera's frame
    ahead = corners[:, 0] >= _NEAR_M
    if not ahead.any():
        return slice(0, 0), slice(0, 0), math.inf
    if not ahead.all():
        # What is left of the box in front of the camera has its corners there, and on the edges that reach behind.
        cut = _EDGES[ahead[_EDGES[:, 0]] != ahead[_EDGES[:, 1]]]
        one, other = corners[cut[:, 0]], corners[cut[:, 1]]
        share = (_NEAR_M - one[:, :1]) / (other[:, :1] - one[:, :1])
        corners = np.concatenate([corners[ahead], one + share * (other - one)])
    forward = np.maximum(corners[:, 0], _NEAR_M)
    u = intrinsics.cx - corners[:, 1] / forward * intrinsics.fx
    v = intrinsics.cy - corners[:, 2] / forward * intrinsics.fy
    return _clip(v, intrinsics.height), _clip(u, intrinsics.width), float(forward.min())


def _clip(pixels: NDArray[np.float64], size: int) -> slice:
    start = min(max(math.floor(pixels.min()), 0), size)
    return slice(start, max(min(math.ceil(pixels.max()) + 1, size), start))
