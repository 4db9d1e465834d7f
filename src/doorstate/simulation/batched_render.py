# SPDX-License-Identifier: Apache-2.0
"""Depth images of many scenes at once with torch, on any device: a slab test (Kay & Kajiya 1986) of every box.

`render` is the reference, in float64. These images have float32: depth agrees to 1e-5 of its value, 1e-4 on capsules,
except in the few pixels at edges that see the surface beside.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from doorstate.io.camera import Intrinsics
from doorstate.simulation.box_faces import place_boxes
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.cast_capsule import capsule_numbers
from doorstate.simulation.scene.box import Box
from doorstate.simulation.z_buffer import NEAR_M, NOTHING, ray_slopes
from doorstate.types import Part

_ALONG = 1e-20  # direction of rays along a face
_FAR_M, _SMALL_M = 1e6, 1e-3  # of boxes that no ray meets


class BoxBatch(NamedTuple):
    """Boxes of S scenes, padded to the N of the largest with boxes that no ray meets."""

    rotation: Tensor  # (S, N, 3, 3) R_box_camera
    origin: Tensor  # (S, N, 3) the camera in the box's frame
    half: Tensor  # (S, N, 3) half sizes
    part: Tensor  # (S, N + 1) uint8; the last is that of no box
    capsules: dict[int, Tensor]  # by number: the scenes in which it is a capsule


class BatchedRender(NamedTuple):
    """Images (S, H, W) on the device of the boxes."""

    depth_m: Tensor  # float32 z-depth, inf where nothing is hit
    part: Tensor  # uint8 doorstate.types.Part
    box: Tensor  # int16 number of the box, -1 where nothing is hit
    incidence_rad: Tensor  # float32, 0 where nothing is hit


def place_batch(
    scenes: Sequence[Sequence[Box]], poses: Sequence[CameraPose], device: torch.device | str = "cpu"
) -> BoxBatch:
    """Return scenes as their cameras see them.

    Args:
        scenes: boxes of each scene in the door frame.
        poses: camera of each scene in the door frame.
        device: device of the tensors.
    """
    most = max(map(len, scenes), default=0)
    shape = (len(scenes), most)
    rotation = np.broadcast_to(np.eye(3), (*shape, 3, 3)).copy()
    origin, half = np.full((*shape, 3), _FAR_M), np.full((*shape, 3), _SMALL_M)
    part = np.full((len(scenes), most + 1), int(Part.NONE), np.uint8)
    for number, (boxes, pose) in enumerate(zip(scenes, poses, strict=True)):
        placed, count = place_boxes(boxes, pose), len(boxes)
        rotation[number, :count], origin[number, :count], half[number, :count] = placed
        part[number, :count] = [box.part for box in boxes]
    capsules: dict[int, list[int]] = {}
    for scene, boxes in enumerate(scenes):
        for number in capsule_numbers(boxes, range(len(boxes))):
            capsules.setdefault(number, []).append(scene)
    chosen = {number: torch.tensor(indices, device=device) for number, indices in capsules.items()}
    tensors = [torch.from_numpy(array).float().to(device) for array in (rotation, origin, half)]
    return BoxBatch(tensors[0], tensors[1], tensors[2], torch.from_numpy(part).to(device), chosen)


def render_batch(boxes: BoxBatch, intrinsics: Intrinsics) -> BatchedRender:
    """Cast one ray per pixel against all boxes and capsules; of two surfaces at one depth the earlier box is seen."""
    device = boxes.half.device
    left, up = (torch.from_numpy(slopes).float().to(device) for slopes in ray_slopes(intrinsics))
    shape = (len(boxes.half), intrinsics.height, intrinsics.width)
    depth = torch.full(shape, torch.inf, device=device)
    cosine = torch.ones(shape, device=device)
    box = torch.full(shape, NOTHING, dtype=torch.int16, device=device)
    for number in range(boxes.half.shape[1]):
        enter, along = _cast(boxes, number, left, up)
        if number in boxes.capsules:
            scenes = boxes.capsules[number]
            enter[scenes], along[scenes] = _cast_capsule(boxes, number, scenes, left, up)
        nearer = enter < depth
        depth = torch.where(nearer, enter, depth)
        cosine = torch.where(nearer, along, cosine)
        box = torch.where(nearer, torch.tensor(number, dtype=torch.int16, device=device), box)
    length = torch.sqrt(1 + left * left + up * up)
    is_hit = box != NOTHING
    angle = torch.where(is_hit, torch.arccos((cosine / length).clamp(max=1)), 0.0)
    numbers = torch.where(is_hit, box.long(), boxes.half.shape[1]).flatten(1)
    return BatchedRender(depth, boxes.part.gather(1, numbers).view(shape), box, angle)


def _cast(boxes: BoxBatch, number: int, left: Tensor, up: Tensor) -> tuple[Tensor, Tensor]:
    """Return the z-depth (S, H, W) at which rays enter one box of each scene, and their component along its normal."""
    rotation, half = boxes.rotation[:, number], boxes.half[:, number]
    origin = boxes.origin[:, number]
    enter = leave = along = None
    for axis in range(3):
        forward, to_left, to_up = (rotation[:, axis, k, None, None] for k in range(3))
        direction = forward + to_left * left + to_up * up
        # A ray along a face is turned by less than any pixel, because infinities would give NaN.
        inverse = torch.where(direction == 0, _ALONG, direction).reciprocal()
        middle, reach = -origin[:, axis, None, None] * inverse, half[:, axis, None, None] * inverse.abs()
        near, far, direction = middle - reach, middle + reach, direction.abs()
        if enter is None or leave is None or along is None:
            enter, leave, along = near, far, direction
        else:
            along = torch.where(near >= enter, direction, along)
            enter, leave = torch.maximum(enter, near), torch.minimum(leave, far)
    assert enter is not None
    assert leave is not None
    assert along is not None
    return torch.where((enter <= leave) & (enter > NEAR_M), enter, torch.inf), along


def _cast_capsule(
    boxes: BoxBatch, number: int, scenes: Tensor, left: Tensor, up: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the same of an upright capsule in some scenes, as `cast_capsule` does."""
    rotation, origin, half = (reals[scenes, number] for reals in (boxes.rotation, boxes.origin, boxes.half))
    rays = (
        rotation[..., None, None, 0] + rotation[..., None, None, 1] * left + rotation[..., None, None, 2] * up
    )
    x, y, z = rays.unbind(1)
    ox, oy, oz = (origin[:, axis, None, None] for axis in range(3))
    radius, reach = half[:, 0, None, None], (half[:, 2] - half[:, 0])[:, None, None]
    # The discriminants as squares of the ray's distance from the axis or centre: the plain form cancels in float32.
    level, flat = x * x + y * y, ox * x + oy * y
    aside = (ox * y - oy * x).square()
    depth = _entry(level, flat, level * radius.square() - aside)
    depth = torch.where((oz + depth * z).abs() > reach, torch.inf, depth)
    square = level + z * z
    for end in (reach, -reach):
        dz = oz - end
        apart = aside + (oy * z - dz * y).square() + (dz * x - ox * z).square()
        depth = torch.minimum(depth, _entry(square, flat + dz * z, square * radius.square() - apart))
    hx, hy, hz = (at + depth * way for at, way in ((ox, x), (oy, y), (oz, z)))
    normal_z = hz - torch.minimum(torch.maximum(hz, -reach), reach)
    return depth, (hx * x + hy * y + normal_z * z).abs() / radius


def _entry(square: Tensor, along: Tensor, discriminant: Tensor) -> Tensor:
    root = (-along - discriminant.clamp(min=0).sqrt()) / square
    return torch.where((discriminant >= 0) & (root > NEAR_M), root, torch.inf)
