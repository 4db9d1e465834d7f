# SPDX-License-Identifier: Apache-2.0
"""Folding doors: one or two pairs of panels that fold out of the wall and stack at the jambs.

Built as all doors: first pair on the right, folding towards the robot; `door_boxes` mirrors it.
"""

from __future__ import annotations

import math

from doorstate.simulation.scene.box import Box, mirror, place
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.fittings import fitting_boxes, with_pane
from doorstate.simulation.scene.handle import handle_boxes
from doorstate.simulation.scene.leaf import finished, leaf_slab

_STACKED_GAP_M = 0.01  # between two panels that are folded together
_STILE_M = 0.06


def folding_panels(door: Door, share: float) -> list[list[Box]]:
    """Return the boxes of each panel in the door frame; the second of each pair has the handle, if there is one."""
    is_pair = door.panels != 4
    clear_m = (door.opening_width_m - 2 * door.leaf_gap_m) / (1 if is_pair else 2)
    width = clear_m / 2
    # The two panels of a pair stand side by side when they are folded.
    stack_m = max(door.leaf_thickness_m, 0.0) + _STACKED_GAP_M
    least_cos = stack_m / max(width, stack_m)
    turn = math.acos(1 - min(max(share, 0.0), 1.0) * (1 - least_cos))
    # The pivot is in the panels' middle plane, so that both panels of a pair turn by the same angle, and moves off the
    # jamb by as much as their edge would cut into it.
    start = -door.opening_width_m / 2 + door.leaf_gap_m + door.leaf_thickness_m / 2 * math.sin(turn)
    y = -door.leaf_recess_m - door.leaf_thickness_m / 2
    apex = (start + width * math.cos(turn), y + width * math.sin(turn))
    first = place(_panel(door, width, 0, has_handle=False), start, y, turn)
    second = place(_panel(door, width, 1, has_handle=True), *apex, -turn)
    if is_pair:
        return [first, second]
    third = place(_panel(door, width, 2, has_handle=False), start, y, turn)
    fourth = place(_panel(door, width, 3, has_handle=False), *apex, -turn)
    return [first, second, mirror(third, x=True), mirror(fourth, x=True)]


def _panel(door: Door, width: float, number: int, has_handle: bool) -> list[Box]:
    """Return a panel whose middle plane is y = 0, from x = 0 to its width."""
    half = door.leaf_thickness_m / 2
    slab = leaf_slab(door.model_copy(update={"hinge_offset_m": -half}), width)
    is_glass = number < (door.glass_panels or 0)
    boxes = with_pane(slab, (_STILE_M, _STILE_M), _STILE_M, 2 * _STILE_M) if is_glass else [slab]
    boxes = finished(door, boxes) + fitting_boxes(door.fittings or (), width, (half, -half))
    if has_handle and door.handle is not None:
        boxes += handle_boxes(door.handle, width, half, 1)
    return boxes
