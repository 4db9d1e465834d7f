# SPDX-License-Identifier: Apache-2.0
"""Exact rays against upright capsules: the first of a cylinder and two spheres, over the pixels that can see them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.simulation.box_faces import PlacedBoxes
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.capsule import Capsule
from doorstate.simulation.z_buffer import NEAR_M, ray_direction, ray_slopes

_Floats = NDArray[np.float64]
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


class CapsuleHits(NamedTuple):
    """Rays of a window of pixels against a capsule; a ray is scaled so that its parameter is z-depth."""

    rows: slice
    columns: slice
    depth_m: _Floats  # (h, w) z-depth at which the ray enters, inf if it misses
    slope: _Floats  # (h, w) |ray . normal| at that point; divided by the ray's length it is the cosine of incidence


def capsule_numbers(boxes: Sequence[Box], numbers: Iterable[int]) -> list[int]:
    """Return the numbers of the capsules among some boxes."""
    return [number for number in numbers if isinstance(boxes[number], Capsule)]


def cast_capsule(placed: PlacedBoxes, number: int, intrinsics: Intrinsics) -> CapsuleHits:
    """Cast the rays of the pixels that can see a capsule, from a camera outside of it.

    Args:
        placed: boxes as the camera sees them.
        number: of the capsule.
        intrinsics: pinhole model of the camera.
    """
    rotation, origin, half = placed.rotation[number], placed.origin[number], placed.half[number]
    rows, columns = _window(rotation, origin, half, intrinsics)
    left, up = ray_slopes(intrinsics)
    x, y, z = (ray_direction(axis, left[:, columns], up[rows]) for axis in rotation)
    radius, reach = half[0], half[2] - half[0]  # reach: from the middle to the centre of a sphere
    ox, oy, oz = origin
    square, along = x * x + y * y, ox * x + oy * y
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = _entry(square, along, ox * ox + oy * oy - radius * radius)
        # Where the cylinder's side ends, the spheres begin.
        depth = np.where(np.abs(oz + depth * z) > reach, np.inf, depth)
        for end in (reach, -reach):
            dz = oz - end
            power = ox * ox + oy * oy + dz * dz - radius * radius
            depth = np.minimum(depth, _entry(square + z * z, along + dz * z, power))
        hx, hy, hz = (at + depth * way for at, way in zip(origin, (x, y, z), strict=True))
        slope = np.abs(hx * x + hy * y + (hz - np.clip(hz, -reach, reach)) * z) / radius
    return CapsuleHits(rows, columns, depth, slope)


def _entry(square: _Floats, along: _Floats, power: float) -> _Floats:
    """Return the smaller root of square t^2 + 2 along t + power; inf where there is none ahead of the camera."""
    root = (-along - np.sqrt(along * along - square * power)) / square
    return np.where(root > NEAR_M, root, np.inf)


def _window(rotation: _Floats, origin: _Floats, half: _Floats, intrinsics: Intrinsics) -> tuple[slice, slice]:
    """Return the rows and columns that can see a box: all, if it is partly behind the camera."""
    corners = (_CORNERS * half - origin) @ rotation  # (8, 3) in the camera's frame
    forward = corners[:, 0]
    if forward.max() < NEAR_M:
        return slice(0, 0), slice(0, 0)
    if forward.min() < NEAR_M:
        return slice(0, intrinsics.height), slice(0, intrinsics.width)
    columns = intrinsics.cx - corners[:, 1] / forward * intrinsics.fx
    rows = intrinsics.cy - corners[:, 2] / forward * intrinsics.fy
    return _clip(rows, intrinsics.height), _clip(columns, intrinsics.width)


def _clip(pixels: _Floats, size: int) -> slice:
    start = min(max(math.floor(pixels.min()), 0), size)
    return slice(start, max(min(math.ceil(pixels.max()) + 1, size), start))
