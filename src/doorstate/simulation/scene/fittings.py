# SPDX-License-Identifier: Apache-2.0
"""Fittings of leaves: vision panels, letter slots, kick and push plates, push bars and viewers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from doorstate._models import FrozenModel, Metres
from doorstate.simulation.scene.box import Box
from doorstate.types import Part

FittingKind = Literal["vision_panel", "letter_slot", "kick_plate", "push_plate", "push_bar", "viewer"]

_PROJECTION_M: dict[FittingKind, float] = {
    "letter_slot": 0.010,
    "kick_plate": 0.0015,
    "push_plate": 0.003,
    "push_bar": 0.09,
    "viewer": 0.008,
}
# On the face that is pushed: away from the side the leaf swings out to.
_ON_ONE_FACE: tuple[FittingKind, ...] = ("push_plate", "push_bar")
_EDGE_M = 0.015  # from a fitting to the edges of its leaf, which close against the stop
_GRIP_M = 0.04
_PANE_M = 0.006


class Fitting(FrozenModel):
    """A rectangular fitting of a leaf; one that is wider than its leaf is cut off near the leaf's edges.

    A vision panel is a pane in a solid leaf. The others are of metal.
    """

    kind: FittingKind
    middle_m: Metres  # height of its middle above the floor
    width_m: Metres
    height_m: Metres
    free_edge_m: Metres | None = None  # from its side to the leaf's free edge; in the leaf's middle if None


def fitting_boxes(fittings: Sequence[Fitting], width_m: float, faces_m: tuple[float, float]) -> list[Box]:
    """Return the boxes on the faces of a leaf, in the leaf's frame; vision panels are in `leaf_with_panel`.

    Args:
        fittings: fittings of the leaf.
        width_m: width of the leaf.
        faces_m: y of the face it swings out of, and of the other one.
    """
    boxes: list[Box] = []
    for fitting in fittings:
        if fitting.kind == "vision_panel":
            continue
        for side, face_m in zip((1, -1), faces_m, strict=True):
            if side < 0 or fitting.kind not in _ON_ONE_FACE:
                boxes += _on_face(fitting, width_m, face_m, side)
    return boxes


def _on_face(fitting: Fitting, width_m: float, face_m: float, side: int) -> list[Box]:
    reach, (x, width) = _PROJECTION_M[fitting.kind], _along(fitting, width_m)
    if fitting.kind != "push_bar":
        center = (x, face_m + side * reach / 2, fitting.middle_m)
        return [Box(Part.LEAF, center, (width, reach, fitting.height_m), material="gloss")]
    stem = reach - _GRIP_M
    posts = [x - width / 2 + _GRIP_M, x + width / 2 - _GRIP_M]
    post_size = (2 * _GRIP_M, stem, fitting.height_m)
    return [
        *(
            Box(Part.LEAF, (at, face_m + side * stem / 2, fitting.middle_m), post_size, material="gloss")
            for at in posts
        ),
        Box(
            Part.LEAF,
            (x, face_m + side * (stem + _GRIP_M / 2), fitting.middle_m),
            (width, _GRIP_M, fitting.height_m),
            material="gloss",
        ),
    ]


def leaf_with_panel(slab: Box, panel: Fitting) -> list[Box]:
    """Return a leaf around a vision panel, in the leaf's frame."""
    (width, _, height), z = slab.size_m, slab.center_m[2]
    x, panel_width = _along(panel, width)
    low = x - panel_width / 2
    rail = max(z + height / 2 - (panel.middle_m + panel.height_m / 2), _EDGE_M)
    bottom = max(panel.middle_m - panel.height_m / 2, z - height / 2 + _EDGE_M)
    return with_pane(slab, (low, width - low - panel_width), rail, bottom)


def with_pane(
    slab: Box, stiles_m: tuple[float, float], rail_m: float, pane_bottom_m: float, pane_m: float = _PANE_M
) -> list[Box]:
    """Return two stiles, two rails and the pane between them instead of a slab.

    Args:
        slab: upright box that is not turned.
        stiles_m: widths of the stiles at the lower and the higher x.
        rail_m: height of the upper rail.
        pane_bottom_m: height of the pane's lower edge above the floor.
        pane_m: thickness of the pane.
    """
    (x, y, z), (width, thickness, height) = slab.center_m, slab.size_m
    (low, high), bottom, top = stiles_m, z - height / 2, z + height / 2
    inner, inner_x, pane_height = width - (low + high), x + (low - high) / 2, top - rail_m - pane_bottom_m
    return [
        slab._replace(center_m=(x - (width - low) / 2, y, z), size_m=(low, thickness, height)),
        slab._replace(center_m=(x + (width - high) / 2, y, z), size_m=(high, thickness, height)),
        slab._replace(center_m=(inner_x, y, top - rail_m / 2), size_m=(inner, thickness, rail_m)),
        slab._replace(
            center_m=(inner_x, y, (bottom + pane_bottom_m) / 2),
            size_m=(inner, thickness, pane_bottom_m - bottom),
        ),
        Box(
            Part.LEAF,
            (inner_x, y, pane_bottom_m + pane_height / 2),
            (inner, pane_m, pane_height),
            material="glass",
        ),
    ]


def _along(fitting: Fitting, leaf_width_m: float) -> tuple[float, float]:
    """Return x of a fitting's middle in the leaf's frame, and its width."""
    width = min(fitting.width_m, leaf_width_m - 2 * _EDGE_M)
    if fitting.free_edge_m is None:
        return leaf_width_m / 2, width
    free_edge = min(max(fitting.free_edge_m, _EDGE_M), leaf_width_m - _EDGE_M - width)
    return leaf_width_m - free_edge - width / 2, width
