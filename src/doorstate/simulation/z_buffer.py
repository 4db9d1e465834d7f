# SPDX-License-Identifier: Apache-2.0
"""The nearest surface of every pixel. A box is drawn face by face, with the bits of a slab test of every pixel.

A ray is `origin + t * direction` with the direction scaled so that t is z-depth, as a depth camera reports it. Along
each axis of a box the direction is linear in the pixel's column and row; for a level camera it depends on one of the
two only, and NumPy's broadcasting then keeps that axis one-dimensional.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.simulation.box_faces import Faces, PlacedBoxes, visible_faces

NOTHING: Final = -1
NEAR_M: Final = 0.01  # no surface is nearer; cameras are at least twice as far from every box
_Floats = NDArray[np.float64]
_Codes = NDArray[np.int16]


class ZBuffer:
    """Depth and face of what was drawn so far; of two surfaces at the same depth, the lower number is seen.

    Attributes:
        placed: boxes by number; may be exchanged between calls.
        depth_m: (H, W) z-depth in metres, inf where nothing is hit.
        face: (H, W) `face_code` of the surface, `NOTHING` where nothing is hit.
    """

    def __init__(self, placed: PlacedBoxes, intrinsics: Intrinsics) -> None:
        shape = (intrinsics.height, intrinsics.width)
        self.depth_m: _Floats = np.full(shape, np.inf)
        self.face: _Codes = np.full(shape, NOTHING, dtype=np.int16)
        self.placed, self._intrinsics = placed, intrinsics
        self._left, self._up = ray_slopes(intrinsics)
        self._last = NOTHING  # highest number that was drawn

    def copy(self) -> ZBuffer:
        """Return a copy that can be drawn upon."""
        other = object.__new__(ZBuffer)
        other.__dict__.update(self.__dict__)
        other.depth_m, other.face = self.depth_m.copy(), self.face.copy()
        return other

    def draw_boxes(self, numbers: Iterable[int]) -> None:
        """Draw boxes by their numbers, which ascend."""
        faces = visible_faces(self.placed, numbers, self._intrinsics)
        columns = np.arange(self._intrinsics.width, dtype=np.int16)
        unsure = (faces.sure != faces.possible).any(axis=(1, 2))
        # A ray along a face divides by zero, and one on it is 0 / 0: such pixels are not sure.
        with np.errstate(divide="ignore", invalid="ignore"):
            for place in range(len(faces.box)):
                self._draw_face(faces, place, columns)
                if unsure[place]:
                    self._draw_pixels(int(faces.box[place]), *_unsure_pixels(faces, place, columns))

    def draw(self, number: int, rows: slice, columns: slice, depth_m: _Floats, axis: int = 0) -> None:
        """Draw a surface over a window of pixels.

        Args:
            number: of the thing that it belongs to.
            rows: rows of the window.
            columns: columns of the window.
            depth_m: z-depth, broadcast to the window; inf where it is missed.
            axis: of the box's face.
        """
        before, face = self.depth_m[rows, columns], self.face[rows, columns]
        self._put(before, face, depth_m, face_code(number, axis), None)

    def _draw_face(self, faces: Faces, place: int, columns: _Codes) -> None:
        number, axis = int(faces.box[place]), int(faces.axis[place])
        rows, window = slice(*faces.rows[place].tolist()), slice(*faces.columns[place].tolist())
        direction = ray_direction(self.placed.rotation[number, axis], self._left[:, window], self._up[rows])
        depth_m = faces.offset_m[place] / direction
        first, last = faces.sure[place, :, rows, None]
        inside = None
        if first.max() > window.start or last.min() < window.stop:
            inside = columns[window] >= first
            inside &= columns[window] < last
        self._put(
            self.depth_m[rows, window], self.face[rows, window], depth_m, face_code(number, axis), inside
        )

    def _put(
        self, before: _Floats, face: _Codes, depth_m: _Floats, code: int, inside: NDArray[np.bool_] | None
    ) -> None:
        hit = depth_m < before
        if code >> 2 < self._last:
            hit |= (depth_m == before) & (face >> 2 > code >> 2)
        if inside is not None:
            hit &= inside
        np.copyto(before, depth_m, where=hit)
        np.copyto(face, np.int16(code), where=hit)
        self._last = max(self._last, code >> 2)

    def _draw_pixels(self, number: int, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> None:
        """Draw a box over single pixels by the slab test (Kay & Kajiya 1986)."""
        enter, leave = np.full(len(rows), NEAR_M), np.full(len(rows), np.inf)
        axes = np.zeros(len(rows), np.int16)
        for axis in range(3):
            direction = ray_direction(
                self.placed.rotation[number, axis], self._left[0, columns], self._up[rows, 0]
            )
            origin, half = self.placed.origin[number, axis], self.placed.half[number, axis]
            low, high = (-half - origin) / direction, (half - origin) / direction
            near = np.minimum(low, high)
            # The face is the one through which the ray enters last.
            axes[near >= enter] = axis
            enter, leave = np.maximum(enter, near), np.minimum(leave, np.maximum(low, high))
        before, face = self.depth_m[rows, columns], self.face[rows, columns]
        hit = (enter <= leave) & ((enter < before) | ((enter == before) & (number < face >> 2)))
        rows, columns = rows[hit], columns[hit]
        self.depth_m[rows, columns] = enter[hit]
        self.face[rows, columns] = face_code(number, 0) + axes[hit]


def face_code(number: int, axis: int) -> int:
    """Return the code of the face of a box (up to 8191) that is normal to an axis."""
    return number << 2 | axis


def box_of(face: _Codes) -> _Codes:
    """Return the numbers of the boxes of face codes, NOTHING where nothing is hit."""
    return face >> 2


def ray_slopes(intrinsics: Intrinsics) -> tuple[_Floats, _Floats]:
    """Return the slopes of the rays to the left (1, W) and up (H, 1)."""
    columns, rows = (np.arange(size, dtype=np.float64) for size in (intrinsics.width, intrinsics.height))
    left: _Floats = -(columns[None, :] - intrinsics.cx) / intrinsics.fx
    up: _Floats = -(rows[:, None] - intrinsics.cy) / intrinsics.fy
    return left, up


def ray_direction(row: _Floats, left: _Floats, up: _Floats) -> _Floats:
    """Return the component of rays along an axis, whose direction in the camera's frame is `row`."""
    direction = np.full((1,) * left.ndim, row[0])
    if row[1]:
        direction = direction + row[1] * left
    if row[2]:
        direction = direction + row[2] * up
    return direction


def _unsure_pixels(faces: Faces, place: int, columns: _Codes) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows and columns of the pixels that may be inside a face, without those that surely are."""
    differ = np.flatnonzero((faces.sure[place] != faces.possible[place]).any(axis=0))
    (first, last), (earliest, latest) = (
        faces.sure[place][:, differ, None],
        faces.possible[place][:, differ, None],
    )
    unsure = (columns >= earliest) & (columns < latest) & ~((columns >= first) & (columns < last))
    found, column = np.nonzero(unsure)
    return differ[found], column
