# SPDX-License-Identifier: Apache-2.0
"""Leaves: solid, glazed, full glass and sliding, with their handles.

Frame of a leaf: origin on the hinge pin, x from the hinge to the free edge, y out of the face it swings out of, z up.
"""

from __future__ import annotations

from doorstate.simulation.scene.box import Box, place
from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.frame import SLIDING_OVERLAP_M
from doorstate.simulation.scene.handle import Handle, handle_boxes
from doorstate.types import Part

_STILE_M = 0.12
_PANE_M, _FULL_PANE_M = 0.006, 0.010
_RAIL_M = 0.08


def leaf_widths_m(door: Door) -> tuple[float, float]:
    """Return the widths of the active and the passive leaf; the latter is 0 for one leaf."""
    gaps = 3 if door.is_double else 2
    both = door.opening_width_m - gaps * door.leaf_gap_m
    return door.active_share * both, (1 - door.active_share) * both


def hinged_leaf(door: Door, width_m: float, handle: Handle | None) -> list[Box]:
    """Return one leaf with its handles, in the leaf's frame."""
    slab = leaf_slab(door, width_m)
    if door.kind == "glazed":
        boxes = _glazed(slab, door.pane_bottom_m or _STILE_M)
    elif door.kind == "full_glass":
        boxes = _full_glass(slab)
    else:
        boxes = [slab]
    if handle is not None:
        outer = -door.hinge_offset_m
        boxes += handle_boxes(handle, width_m, outer, 1)
        boxes += handle_boxes(handle, width_m, outer - door.leaf_thickness_m, -1)
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
    """Return the closed leaf in the door frame, with a bar on the face away from the wall if it has a handle."""
    overlap = sliding_overlap_m(door)
    bottom = door.threshold_m + door.leaf_floor_gap_m
    height = door.opening_height_m + overlap - bottom
    width = door.opening_width_m + 2 * overlap
    y = -door.leaf_recess_m - door.leaf_thickness_m / 2
    slab = Box(Part.LEAF, (0.0, y, bottom + height / 2), (width, door.leaf_thickness_m, height))
    if door.handle is None:
        return [slab]
    grip = handle_boxes(door.handle, width, -door.leaf_recess_m, 1)
    return [slab, *place(grip, -width / 2, 0.0, 0.0)]


def _glazed(slab: Box, pane_bottom: float) -> list[Box]:
    """Return two stiles, two rails and the pane between them."""
    (x, y, z), (width, thickness, height) = slab.center_m, slab.size_m
    bottom, top = z - height / 2, z + height / 2
    inner, pane_height = width - 2 * _STILE_M, top - _STILE_M - pane_bottom
    pane_z = pane_bottom + pane_height / 2
    return [
        slab._replace(center_m=(x - (width - _STILE_M) / 2, y, z), size_m=(_STILE_M, thickness, height)),
        slab._replace(center_m=(x + (width - _STILE_M) / 2, y, z), size_m=(_STILE_M, thickness, height)),
        slab._replace(center_m=(x, y, top - _STILE_M / 2), size_m=(inner, thickness, _STILE_M)),
        slab._replace(
            center_m=(x, y, (bottom + pane_bottom) / 2), size_m=(inner, thickness, pane_bottom - bottom)
        ),
        Box(Part.LEAF, (x, y, pane_z), (inner, _PANE_M, pane_height), material="glass"),
    ]


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
