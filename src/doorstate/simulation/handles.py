# SPDX-License-Identifier: Apache-2.0
"""Handles: lever, knob or bar on both faces of a leaf."""

from __future__ import annotations

from typing import Literal

from doorstate._models import FrozenModel
from doorstate.simulation.draws import Draws
from doorstate.simulation.scene import Box
from doorstate.types import Part

BACKSET_M = 0.065  # from the leaf's free edge
_ROD_M = 0.02
_KNOB_M = 0.055
_SHARES: dict[Literal["lever", "knob", "bar"], float] = {"lever": 0.6, "knob": 0.2, "bar": 0.2}


class Handle(FrozenModel):
    """A handle; `length_m` is that of a lever's or bar's grip."""

    kind: Literal["lever", "knob", "bar"]
    height_m: float
    projection_m: float
    length_m: float


def draw_handle(draws: Draws, kinds: dict[Literal["lever", "knob", "bar"], float] = _SHARES) -> Handle:
    """0.85 to 1.10 m high; levers 0.12-0.14 m, bars 0.3-0.9 m long, 0.05-0.07 m in front of the leaf."""
    kind = draws.one_of(kinds)
    return Handle(
        kind=kind,
        height_m=draws.between(0.85, 1.10),
        projection_m=draws.between(0.05, 0.07),
        length_m=draws.between(0.3, 0.9) if kind == "bar" else draws.between(0.12, 0.14),
    )


def handle_boxes(handle: Handle, leaf_width_m: float, face_y_m: float, side: int) -> list[Box]:
    """Boxes in the leaf's frame (doors.py) on one face, the one that looks to +y (`side` 1) or to -y (-1)."""
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
