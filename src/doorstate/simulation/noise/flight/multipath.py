# SPDX-License-Identifier: Apache-2.0
"""Multipath: light that reaches a surface by way of another one has come farther, so corners look rounded and deeper.

One reflection is summed over a coarse grid of patches. A patch j that is lit by the sensor lights a patch i with its
albedo times its own light times the form factor; by way of j the light travels r_j + d_ij + r_i instead of 2 r_i. The
measured distance is the mean over both ways, weighted by their light, as long as the difference is well below the
wavelength.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.cast_capsule import capsule_numbers
from doorstate.simulation.noise.optical import Image, View
from doorstate.simulation.noise.windows import enlarge
from doorstate.simulation.render import face_normals
from doorstate.simulation.z_buffer import ray_slopes


class Multipath(FrozenModel):
    """Size of the patches, and the share of the indirect light that several frequencies of modulation leave."""

    columns: int = Field(default=24, ge=2)  # assumed: patches across the image
    left: float = Field(default=0.3, ge=0, le=1)  # assumed: errors of several cm in a corner of white walls
    nearest_m: float = Field(
        default=0.1, gt=0
    )  # assumed: closer patches light each other as at this distance


def multipath_bias(view: View, albedo: Image, cosine: Image, multipath: Multipath) -> Image:
    """Return how much farther each pixel is measured than it is, in metres along its ray; (H, W), never negative."""
    height, width = albedo.shape
    step = -(-width // multipath.columns)
    grid = np.s_[step // 2 :: step, step // 2 :: step]
    depth_m = view.rendered.depth_m[grid]
    patches = _patches(view, grid, depth_m, albedo[grid], cosine[grid], step)
    bias = np.zeros(depth_m.shape, np.float32)
    bias.ravel()[patches.number] = _gather(patches, multipath)
    # The first value lies half a step inside the image.
    padded = np.pad(bias, 1, mode="edge")
    return enlarge(padded, (height, width), step, [step - step // 2] * 2)


class _Patches(NamedTuple):
    """M patches that are hit: flat index, position and unit normal (3, M), distance, light, and light times area."""

    number: NDArray[np.intp]
    position_m: Image
    normal: Image
    distance_m: Image
    light: Image
    flux: Image


def _patches(
    view: View, grid: tuple[slice, slice], depth_m: Image, albedo: Image, cosine: Image, step: int
) -> _Patches:
    assert view.rendered.face is not None
    number = np.flatnonzero(np.isfinite(depth_m) & (cosine > np.float32(0.01)))
    depth = depth_m.ravel()[number]
    left, up = ray_slopes(view.intrinsics)
    left, up = np.broadcast_arrays(left[:, grid[1]], up[grid[0]])
    ray = np.stack([np.ones(len(number)), left.ravel()[number], up.ravel()[number]]).astype(np.float32)
    length = np.sqrt(ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
    faces = view.rendered.face[grid].ravel()[number].astype(np.intp)
    normal = face_normals(view.boxes, view.pose).astype(np.float32).take(faces, axis=1)
    # Towards the camera.
    away = normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2] > 0
    normal[:, away] *= np.float32(-1)
    # A round body lights its surroundings about as a surface that faces the camera.
    capsules = capsule_numbers(view.boxes, range(len(view.boxes)))
    body = np.isin(view.rendered.box[grid].ravel()[number], list(capsules))
    normal[:, body] = -ray[:, body] / length[body]
    distance = depth * length
    facing = cosine.ravel()[number]
    light: Image = np.divide(facing, distance * distance)
    # The solid angle of a pixel is 1 / (fx fy length^3).
    pixel = np.float32(step**2 / (view.intrinsics.fx * view.intrinsics.fy))
    solid = pixel / (length * length * length)
    area = solid * distance * distance / facing
    return _Patches(number, ray * depth, normal, distance, light, albedo.ravel()[number] * light * area)


def _gather(patches: _Patches, multipath: Multipath) -> Image:
    """Return the bias (M,) of each patch."""
    # (j, i): sums over j add whole rows, in order.
    offset = [axis[None, :] - axis[:, None] for axis in patches.position_m]
    square = offset[0] * offset[0]
    square += offset[1] * offset[1]
    square += offset[2] * offset[2]
    leaves = sum(n[:, None] * o for n, o in zip(patches.normal, offset, strict=True))
    arrives = sum(n[None, :] * o for n, o in zip(patches.normal, offset, strict=True))
    np.maximum(leaves, np.float32(0), out=leaves)
    np.maximum(np.negative(arrives, out=arrives), np.float32(0), out=arrives)
    near = np.maximum(square, np.float32(multipath.nearest_m**2))
    share = leaves
    share *= arrives
    share /= near * near
    share *= (patches.flux * np.float32(multipath.left / math.pi))[:, None]
    detour = np.sqrt(square)
    detour += patches.distance_m[:, None]
    detour -= patches.distance_m[None, :]
    np.maximum(detour, np.float32(0), out=detour)
    indirect = np.add.reduce(share, axis=0)
    detour *= share
    longer: Image = np.add.reduce(detour, axis=0)
    longer *= np.float32(0.5)
    longer /= patches.light + indirect
    return longer
