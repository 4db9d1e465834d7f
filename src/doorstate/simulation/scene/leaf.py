# SPDX-License-Identifier: Apache-2.0
"""Leaves: solid, glazed, full glass and sliding, with their fittings and handles.

Frame of a leaf: origin on the hinge pin, x from the hinge to the free edge, y out of the face it swings out of, z up.
"""

from __future__ import annotations

from doorstate.simulation.scene.box import Box, place
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.fittings import fitting_boxes, leaf_with_panel, with_pane
from doorstate.simulation.scene.frame import SLIDING_OVERLAP_M
from doorstate.simulation.scene.handle import Handle, handle_boxes
from doorstate.types import Part

_STILE_M = 0.12
_FULL_PANE_M = 0.010
_RAIL_M = 0.08


def leaf_widths_m(door: Door) -> tuple[float, float]:
    """Return the widths of the active and the passive leaf; the latter is 0 for one leaf."""
    gaps = 3 if door.is_double else 2
    both = door.opening_width_m - gaps * door.leaf_gap_m
    return door.active_share * both, (1 - door.active_share) * both


def hinged_leaf(door: Door, width_m: float, handle: Handle | None) -> list[Box]:
    """Return one leaf with its fittings and handles, in the leaf's frame."""
    outer, inner = -door.hinge_offset_m, -door.hinge_offset_m - door.leaf_thickness_m
    slab = leaf_slab(door, width_m)
    if door.kind == "glazed":
        stile, pane_bottom = _STILE_M, door.pane_bottom_m or _STILE_M
        boxes = with_pane(slab, (stile, stile), stile, pane_bottom)
    elif door.kind == "full_glass":
        boxes = _full_glass(slab)
    else:
        boxes = _solid(door, slab)
    boxes = finished(door, boxes) + fitting_boxes(door.fittings or (), width_m, (outer, inner))
    if handle is not None:
        boxes += handle_boxes(handle, width_m, outer, 1)
        boxes += handle_boxes(handle, width_m, inner, -1)
    return boxes


def leaf_slab(door: Door, width_m: float) -> Box:
    """Return the outline of a leaf as one box, in the leaf's frame."""
    bottom = door.threshold_m + door.leaf_floor_gap_m
    height = door.opening_height_m - door.leaf_gap_m - bottom
    y = -door.hinge_offset_m - door.leaf_thickness_m / 2
    return Box(Part.LEAF, (width_m / 2, y, bottom + height / 2), (width_m, door.leaf_thickness_m, height))


def sliding_overlap_m(door: Door) -> float:
    """Return the width of wall that a sliding leaf covers on each side; 0 for a leaf in a pocket."""
    return SLIDING_OVERLAP_M if door.leaf_recess_m < 0 else 0.0


def sliding_leaf(door: Door) -> list[Box]:
    """Return the closed leaf in the door frame, the one on the right of two; a handle is on the face off the wall."""
    overlap = sliding_overlap_m(door)
    bottom = door.threshold_m + door.leaf_floor_gap_m
    height = door.opening_height_m + overlap - bottom
    double = door.kind == "sliding_double"
    width = door.opening_width_m / 2 + overlap if double else door.opening_width_m + 2 * overlap
    outer, inner = -door.leaf_recess_m, -door.leaf_recess_m - door.leaf_thickness_m
    y = -door.leaf_recess_m - door.leaf_thickness_m / 2
    slab = Box(Part.LEAF, (width / 2, y, bottom + height / 2), (width, door.leaf_thickness_m, height))
    boxes = finished(door, _full_glass(slab) if door.glass_panels else _solid(door, slab))
    boxes += fitting_boxes(door.fittings or (), width, (outer, inner))
    if door.handle is not None:
        boxes += handle_boxes(door.handle, width, outer, 1)
    return place(boxes, -width if double else -width / 2, 0.0, 0.0)


def _solid(door: Door, slab: Box) -> list[Box]:
    panel = next((fitting for fitting in door.fittings or () if fitting.kind == "vision_panel"), None)
    return [slab] if panel is None else leaf_with_panel(slab, panel)


def finished(door: Door, boxes: list[Box]) -> list[Box]:
    """Return boxes whose solid ones are of the leaf's material."""
    if door.leaf_material is None:
        return boxes
    return [box if box.material == "glass" else box._replace(material=door.leaf_material) for box in boxes]


def _full_glass(slab: Box) -> list[Box]:
    """Return a rail along the floor, the fitting of the upper hinge, and the pane."""
    (x, y, z), (width, thickness, height) = slab.center_m, slab.size_m
    bottom, top = z - height / 2, z + height / 2
    fitting = (2 * _RAIL_M, thickness, _RAIL_M)
    return [
        slab._replace(center_m=(x, y, bottom + _RAIL_M / 2), size_m=(width, thickness, _RAIL_M)),
        slab._replace(center_m=(x - width / 2 + _RAIL_M, y, top - _RAIL_M / 2), size_m=fitting),
        Box(
            Part.LEAF,
            (x, y, z + _RAIL_M / 2),
            (width, _FULL_PANE_M, height - _RAIL_M),
            material="glass",
        ),
    ]
