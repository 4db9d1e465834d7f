# SPDX-License-Identifier: Apache-2.0
"""Handles: lever, knob or bar on a face of a leaf."""

from __future__ import annotations

from typing import Literal

from doorstate._models import FrozenModel, Metres
from doorstate.simulation.scene.box import Box
from doorstate.types import Part

HandleKind = Literal["lever", "knob", "bar"]

BACKSET_M = 0.065  # from the leaf's free edge
_ROD_M = 0.02
_KNOB_M = 0.055


class Handle(FrozenModel):
    """A handle; `length_m` is the length of a lever's or bar's grip."""

    kind: HandleKind
    height_m: Metres
    projection_m: Metres
    length_m: Metres


def handle_boxes(handle: Handle, leaf_width_m: float, face_y_m: float, side: int) -> list[Box]:
    """Return boxes in the leaf's frame on one face.

    Args:
        handle: kind and sizes.
        leaf_width_m: width of the leaf.
        face_y_m: y of the face.
        side: direction of the face's normal, 1 for +y and -1 for -y.
    """
    x, reach, z = leaf_width_m - BACKSET_M, handle.projection_m, handle.height_m

    def box(at_x: float, out_m: float, at_z: float, size: tuple[float, float, float]) -> Box:
        return Box(Part.LEAF, (at_x, face_y_m + side * out_m, at_z), size)

    if handle.kind == "bar":
        posts = [z - handle.length_m / 2 + 0.05, z + handle.length_m / 2 - 0.05]
        grip = box(x, reach - _ROD_M / 2, z, (_ROD_M, _ROD_M, handle.length_m))
        stem = reach - _ROD_M
        return [*(box(x, stem / 2, post, (_ROD_M, stem, _ROD_M)) for post in posts), grip]
    if handle.kind == "knob":
        stem = reach - _KNOB_M / 2
        return [
            box(x, stem / 2, z, (_ROD_M, stem, _ROD_M)),
            box(x, reach - _KNOB_M / 4, z, (_KNOB_M, _KNOB_M / 2, _KNOB_M)),
        ]
    return [
        box(x, reach / 2, z, (_ROD_M, reach, _ROD_M)),
        box(x - handle.length_m / 2, reach - _ROD_M / 2, z, (handle.length_m, _ROD_M, _ROD_M)),
    ]
