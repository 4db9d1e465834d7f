# SPDX-License-Identifier: Apache-2.0
"""Window sashes: a casement around a pane."""

from __future__ import annotations

from doorstate.simulation.scene.box import Box
from doorstate.types import Part

CASEMENT_M, PANE_M = 0.06, 0.02


def sash_boxes(width_m: float, bottom_m: float, top_m: float, y_m: float) -> list[Box]:
    """Return two posts, two rails and the pane between them, with the middle on x = 0."""
    width, low, high = width_m, bottom_m, top_m
    y, z, bar = y_m, (low + high) / 2, CASEMENT_M
    inner = width - 2 * bar
    posts = [
        Box(Part.OTHER, (x, y, z), (bar, bar, high - low)) for x in ((bar - width) / 2, (width - bar) / 2)
    ]
    rails = [
        Box(Part.OTHER, (0.0, y, rail_z), (inner, bar, bar)) for rail_z in (low + bar / 2, high - bar / 2)
    ]
    pane = Box(Part.OTHER, (0.0, y, z), (inner, PANE_M, high - low - 2 * bar), material="glass")
    return [*posts, *rails, pane]
