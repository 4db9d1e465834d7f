# SPDX-License-Identifier: Apache-2.0
"""Random fittings and materials of leaves; ranges and chances are those of the data card, all assumed."""

from __future__ import annotations

from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.door import LeafMaterial
from doorstate.simulation.scene.fittings import Fitting

_MATERIALS: dict[LeafMaterial | None, float] = {None: 0.70, "dark": 0.15, "gloss": 0.15}
_PANEL_CHANCE, _PLATE_CHANCE, _PUSH_BAR_CHANCE, _PUSH_PLATE_CHANCE = 0.25, 0.15, 0.10, 0.05
_SLOT_CHANCE, _VIEWER_CHANCE = 0.05, 0.10
_LEAST_FOR_PLATE_M = 0.6  # of a pane's lower edge


def draw_leaf_material(stream: Stream) -> LeafMaterial | None:
    """Draw the material of the solid parts: matte (None) in 70 %, dark and gloss in 15 % each."""
    return stream.choice(_MATERIALS)


def draw_fittings(stream: Stream, pane_bottom_m: float | None = None) -> tuple[Fitting, ...] | None:
    """Draw the fittings of a hinged leaf; most leaves have none.

    Args:
        stream: random numbers.
        pane_bottom_m: lower edge of the pane of a glazed leaf, which gets no fittings but a kick plate; None for a
            solid leaf.
    """
    fittings = []
    if stream.chance(_PLATE_CHANCE) and (pane_bottom_m is None or pane_bottom_m >= _LEAST_FOR_PLATE_M):
        height = stream.uniform(0.15, 0.40)
        fittings.append(_fitting("kick_plate", 0.02 + height / 2, 3.0, height))
    if pane_bottom_m is None:
        fittings += _draw_of_solid_leaf(stream)
    return tuple(fittings) or None


def _draw_of_solid_leaf(stream: Stream) -> list[Fitting]:
    fittings = []
    if stream.chance(_PANEL_CHANCE):
        fittings.append(_draw_panel(stream))
    elif stream.chance(_VIEWER_CHANCE):
        fittings.append(_fitting("viewer", stream.uniform(1.40, 1.60), 0.03, 0.03))
    if stream.chance(_PUSH_BAR_CHANCE):
        fittings.append(_fitting("push_bar", stream.uniform(0.90, 1.10), stream.uniform(0.5, 1.2), 0.06))
    elif stream.chance(_PUSH_PLATE_CHANCE):
        fittings.append(_fitting("push_plate", stream.uniform(1.10, 1.30), 0.10, 0.30, 0.03))
    elif stream.chance(_SLOT_CHANCE):
        middle, width = stream.uniform(0.40, 0.80), stream.uniform(0.25, 0.35)
        fittings.append(_fitting("letter_slot", middle, width, stream.uniform(0.04, 0.08)))
    return fittings


def _draw_panel(stream: Stream) -> Fitting:
    """Draw a narrow panel near the handle, or a square one in the middle."""
    if stream.chance(0.5):
        size = stream.uniform(0.08, 0.20), stream.uniform(0.50, 1.20)
        return _fitting("vision_panel", stream.uniform(1.30, 1.45), *size, stream.uniform(0.13, 0.20))
    side = stream.uniform(0.20, 0.45)
    return _fitting("vision_panel", stream.uniform(1.40, 1.60), side, side)


def _fitting(
    kind: str, middle_m: float, width_m: float, height_m: float, edge_m: float | None = None
) -> Fitting:
    return Fitting.model_validate(
        {
            "kind": kind,
            "middle_m": round(middle_m, 4),
            "width_m": width_m,
            "height_m": height_m,
            "free_edge_m": edge_m,
        }
    )
