# SPDX-License-Identifier: Apache-2.0
"""Depth images of scenes of boxes: exact z-depth, part, box and incidence of every pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate.io.camera import Intrinsics
from doorstate.simulation.box_faces import place_boxes
from doorstate.simulation.camera import CameraPose, DepthCamera
from doorstate.simulation.cast_capsule import capsule_numbers, cast_capsule
from doorstate.simulation.scene.box import Box, Material
from doorstate.simulation.z_buffer import NOTHING, ZBuffer, box_of, ray_slopes
from doorstate.types import DepthImage, Part

NO_BOX = NOTHING


class Render(NamedTuple):
    """Depth, part and box of every pixel."""

    depth_m: DepthImage  # (H, W) z-depth, inf where nothing is hit
    part: NDArray[np.uint8]  # (H, W) doorstate.types.Part, NONE where nothing is hit
    box: NDArray[np.int16]  # (H, W) index of the box, NO_BOX where nothing is hit
    face: NDArray[np.int16] | None = None  # (H, W) `z_buffer.face_code`; also where a pixel was lost later
    pane: NDArray[np.bool_] | None = (
        None  # (H, W) of `render_behind_glass`: seen through a pane; None without panes
    )


def render(boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics) -> Render:
    """Cast one ray per pixel against all boxes; of two surfaces at the same depth the earlier box wins.

    Returns:
        Depth (H, W) float32 in metres, part (H, W) uint8 and box (H, W) int16.
    """
    buffer = ZBuffer(place_boxes(boxes, pose), intrinsics)
    _draw(buffer, boxes, range(len(boxes)), intrinsics)
    return _rendered(buffer, boxes)


def render_behind_glass(boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics) -> Render:
    """Cast rays as `render` does, without boxes of glass: the opaque surface behind each pane."""
    return render_states([boxes], pose, intrinsics)[0]


def render_states(states: Sequence[Sequence[Box]], pose: CameraPose, intrinsics: Intrinsics) -> list[Render]:
    """Return `render_behind_glass` of lists of boxes; what they have in common is drawn once.

    Args:
        states: boxes of each state of a scene. Lists of the same materials share the boxes that are the same in all.
        pose: camera in the door frame.
        intrinsics: pinhole model of the camera.
    """
    if len({tuple(box.material for box in boxes) for boxes in states}) > 1:
        return [render_behind_glass(boxes, pose, intrinsics) for boxes in states]
    shared = [len({(type(box), box) for box in versions}) == 1 for versions in zip(*states, strict=True)]
    opaque = [box.material != "glass" for box in states[0]]
    background = ZBuffer(place_boxes(states[0], pose), intrinsics)
    _draw(background, states[0], np.flatnonzero(np.logical_and(shared, opaque)).tolist(), intrinsics)
    own = np.flatnonzero(np.logical_and(np.logical_not(shared), opaque)).tolist()
    panes = np.flatnonzero(np.logical_not(opaque)).tolist()
    renders = []
    for boxes in states:
        buffer = background.copy()
        buffer.placed = place_boxes(boxes, pose)
        _draw(buffer, boxes, own, intrinsics)
        rendered = _rendered(buffer, boxes)
        if panes:
            behind = buffer.face.copy()
            buffer.draw_boxes(panes)
            rendered = rendered._replace(pane=behind != buffer.face)
        renders.append(rendered)
    return renders


def _draw(buffer: ZBuffer, boxes: Sequence[Box], numbers: Sequence[int], intrinsics: Intrinsics) -> None:
    capsules = capsule_numbers(boxes, numbers)
    buffer.draw_boxes(number for number in numbers if number not in capsules)
    for number in capsules:
        hits = cast_capsule(buffer.placed, number, intrinsics)
        buffer.draw(number, hits.rows, hits.columns, hits.depth_m)


def _rendered(buffer: ZBuffer, boxes: Sequence[Box]) -> Render:
    box = box_of(buffer.face)
    # NO_BOX is -1 and so indexes the last entry.
    parts = np.array([*(box.part for box in boxes), Part.NONE], dtype=np.uint8)
    return Render(buffer.depth_m.astype(np.float32), parts.take(box, mode="wrap"), box, buffer.face.copy())


def face_normals(boxes: Sequence[Box], pose: CameraPose) -> NDArray[np.float64]:
    """Return the unit normal of each face in the camera's frame, up to its sign: (3, codes) forward, left and up.

    A column is a code of `Render.face`; `NOTHING` is -1 and so indexes the last one, which is 0. Columns of capsules
    mean nothing.
    """
    # One code for each axis of a box, and one that is left out.
    normals = np.zeros((len(boxes) + 1, 4, 3))
    normals[:-1, :3] = place_boxes(boxes, pose).rotation
    return normals.reshape(-1, 3).T.copy()


def against_normal(
    rendered: Render,
    boxes: Sequence[Box],
    pose: CameraPose,
    intrinsics: Intrinsics,
    dtype: type[np.floating[Any]] = np.float64,
) -> NDArray[Any]:
    """Return the component (H, W) of each ray, 1 long ahead, along the normal of the surface it hits.

    Divided by the ray's length it is the cosine of the angle of incidence; where nothing is hit it means nothing.
    """
    assert rendered.face is not None
    forward, to_left, to_up = face_normals(boxes, pose).astype(dtype)
    face = rendered.face.astype(np.intp)
    left, up = (slope.astype(dtype) for slope in ray_slopes(intrinsics))
    component: NDArray[Any] = to_left.take(face, mode="wrap")
    component *= left
    component += forward.take(face, mode="wrap")
    rise = to_up.take(face, mode="wrap")
    rise *= up
    component += rise
    if capsules := capsule_numbers(boxes, range(len(boxes))):
        placed = place_boxes(boxes, pose)
    for number in capsules:
        hits = cast_capsule(placed, number, intrinsics)
        seen = box_of(rendered.face[hits.rows, hits.columns]) == number
        np.copyto(component[hits.rows, hits.columns], hits.slope, where=seen, casting="same_kind")
    np.abs(component, out=component)
    return component


def incidence(
    rendered: Render, boxes: Sequence[Box], pose: CameraPose, intrinsics: Intrinsics
) -> NDArray[np.float32]:
    """Return the angle between each pixel's ray and the normal of the surface it hits, exact from the box.

    Args:
        rendered: result of a rendering of the same boxes, before or after `cut_range`.
        boxes: scene in the door frame.
        pose: camera in the door frame.
        intrinsics: pinhole model of the camera.

    Returns:
        (H, W) float32 radians in [0, pi / 2]; 0 where nothing is hit.
    """
    cosine = against_normal(rendered, boxes, pose, intrinsics)
    left, up = ray_slopes(intrinsics)
    cosine /= np.sqrt(1 + left * left + up * up)
    angle: NDArray[np.float32] = np.arccos(cosine, out=cosine).astype(np.float32)
    np.copyto(angle, np.float32(0), where=rendered.box == NO_BOX)
    return angle


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
    return rendered._replace(
        depth_m=np.where(valid, rendered.depth_m, np.float32(np.nan)),
        part=rendered.part | -lost.view(np.uint8),
        box=rendered.box | -lost.astype(np.int16),
    )
