# SPDX-License-Identifier: Apache-2.0
"""Doors of many kinds as boxes: single, double, sliding, glazed and full glass, with handles and a threshold.

A leaf's own frame: origin on the hinge's pin, x from the hinge to the free edge, y out of the face it swings out of, z
up. Doors are built with the hinge on the right and the leaf towards the robot, then mirrored to what they are.
"""

from __future__ import annotations

import math
from typing import Literal

from doorstate._models import FrozenModel
from doorstate.simulation.handles import Handle, handle_boxes
from doorstate.simulation.plan import collide, distance_m, mirror, place
from doorstate.simulation.scene import Box, Door, frame_boxes, wall_boxes
from doorstate.types import Part

DoorKind = Literal["single", "double_equal", "double_unequal", "sliding", "glazed", "full_glass"]

SLIDING_OVERLAP_M = 0.03  # of a leaf in front of the wall, at both sides and above
_STILE_M = 0.12
_PANE_M, _FULL_PANE_M = 0.006, 0.010
_RAIL_M = 0.08
_TRACK_M = 0.05
_WIDEST_DEG, _STEP_DEG = 170, 5


class VariedDoor(Door):
    """A door of any kind; `hinge` and `swing` are those of the active leaf.

    Of a sliding door `hinge` is the side that it opens to, and `swing` the face of the wall that it runs along.
    """

    kind: DoorKind = "single"
    leaf_recess_m: float = 0.0  # of the leaf's face behind the wall's; negative in front of it
    hinge_offset_m: float = 0.0  # of the pin in front of the leaf's face
    active_share: float = 1.0  # of the leaves' width
    pane_bottom_m: float | None = None  # of a glazed leaf
    threshold_m: float = 0.0
    handle: Handle | None = None

    @property
    def is_double(self) -> bool:
        """Whether it has a second, passive leaf."""
        return self.kind in ("double_equal", "double_unequal")

    @property
    def is_sliding(self) -> bool:
        """Whether it opens by a share of its width and not by an angle."""
        return self.kind == "sliding"


class Opening(FrozenModel):
    """How far a door is open: its active and passive leaves' angles or, if it slides, the share of its width."""

    angle_deg: float = 0.0
    passive_angle_deg: float = 0.0
    share: float = 0.0


def door_boxes(door: VariedDoor, opening: Opening) -> list[Box]:
    """Wall, frame and leaves in the door frame (scene.py); the wall comes first and the leaves last."""
    return [*fixed_boxes(door), *leaf_boxes(door, opening)]


def fixed_boxes(door: VariedDoor) -> list[Box]:
    """What does not move: wall, frame, threshold, and the track of a sliding leaf."""
    built = _as_built(door)
    boxes = [*wall_boxes(built), *frame_boxes(built, door.leaf_recess_m)]
    if door.threshold_m:
        size = (door.opening_width_m, door.wall_thickness_m, door.threshold_m)
        boxes.append(Box(Part.FRAME, (0.0, -door.wall_thickness_m / 2, door.threshold_m / 2), size))
    if door.is_sliding and door.leaf_recess_m < 0:
        z = door.opening_height_m + SLIDING_OVERLAP_M + _TRACK_M / 2
        size = (2 * door.opening_width_m, -door.leaf_recess_m, _TRACK_M)
        boxes.append(Box(Part.FRAME, (-door.opening_width_m / 2, -door.leaf_recess_m / 2, z), size))
    return _as_hung([box for box in boxes if min(box.size_m) > 0], door)


def leaf_boxes(door: VariedDoor, opening: Opening) -> list[Box]:
    """Leaves with their handles."""
    if door.is_sliding:
        leaf = _sliding_leaf(door)
        return _as_hung(place(leaf, -opening.share * door.opening_width_m, 0.0, 0.0), door)
    boxes = _turned(door, _leaf(door, _leaf_widths(door)[0], door.handle), opening.angle_deg)
    if door.is_double:
        passive = _leaf(door, _leaf_widths(door)[1], None)
        boxes += mirror(_turned(door, passive, opening.passive_angle_deg), x=True)
    return _as_hung(boxes, door)


def passable_width_m(door: VariedDoor, opening: Opening) -> float:
    """The narrowest gap, in plan, that a robot has to go through: between the active leaf and the other side's jamb.

    With a double door the other side is the passive leaf and its jamb. Handles do not count.
    """
    width = door.opening_width_m
    if door.is_sliding:
        return max(0.0, opening.share * width - _overlap_m(door))
    jamb = Box(
        Part.FRAME,
        (width / 2 + door.jamb_thickness_m / 2, -door.wall_thickness_m / 2, 1.0),
        (door.jamb_thickness_m, door.wall_thickness_m, 2.0),
    )
    active_m, passive_m = _leaf_widths(door)
    (active,) = _turned(door, [_slab(door, active_m)], opening.angle_deg)
    gaps = [width, distance_m(active, jamb)]
    if door.is_double:
        (passive,) = mirror(_turned(door, [_slab(door, passive_m)], opening.passive_angle_deg), x=True)
        gaps += [distance_m(active, passive), distance_m(passive, mirror([jamb], x=True)[0])]
    return min(gaps)


def free_angle_deg(door: VariedDoor, obstacles: list[Box]) -> int:
    """How far, up to 170 degrees and in steps of 5, the leaves turn before they meet an obstacle or their own frame."""
    around = [*fixed_boxes(door), *obstacles]
    for angle in range(_STEP_DEG, _WIDEST_DEG + 1, _STEP_DEG):
        if collide(leaf_boxes(door, Opening(angle_deg=angle, passive_angle_deg=angle)), around):
            return angle - _STEP_DEG
    return _WIDEST_DEG


def _as_built(door: VariedDoor) -> VariedDoor:
    return door.model_copy(update={"hinge": "right", "swing": "towards"})


def _as_hung(boxes: list[Box], door: VariedDoor) -> list[Box]:
    middle = -door.wall_thickness_m / 2
    return mirror(boxes, x=door.hinge == "left", about_y_m=middle if door.swing == "away" else None)


def _leaf_widths(door: VariedDoor) -> tuple[float, float]:
    gaps = 3 if door.is_double else 2
    both = door.opening_width_m - gaps * door.leaf_gap_m
    return door.active_share * both, (1 - door.active_share) * both


def _turned(door: VariedDoor, leaf: list[Box], angle_deg: float) -> list[Box]:
    x = -door.opening_width_m / 2 + door.leaf_gap_m
    return place(leaf, x, door.hinge_offset_m - door.leaf_recess_m, math.radians(angle_deg))


def _slab(door: VariedDoor, width: float) -> Box:
    """The whole leaf as one box, in its own frame."""
    bottom = door.threshold_m + door.leaf_floor_gap_m
    height = door.opening_height_m - door.leaf_gap_m - bottom
    y = -door.hinge_offset_m - door.leaf_thickness_m / 2
    return Box(Part.LEAF, (width / 2, y, bottom + height / 2), (width, door.leaf_thickness_m, height))


def _leaf(door: VariedDoor, width: float, handle: Handle | None) -> list[Box]:
    slab = _slab(door, width)
    if door.kind == "glazed":
        boxes = _glazed(slab, door.pane_bottom_m or _STILE_M)
    elif door.kind == "full_glass":
        boxes = _full_glass(slab)
    else:
        boxes = [slab]
    if handle is not None:
        outer = -door.hinge_offset_m
        boxes += handle_boxes(handle, width, outer, 1)
        boxes += handle_boxes(handle, width, outer - door.leaf_thickness_m, -1)
    return boxes


def _glazed(slab: Box, pane_bottom: float) -> list[Box]:
    """Two stiles, two rails and a pane between them."""
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
    """A pane that stands in a rail along the floor, and the fitting of its upper hinge."""
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


def _overlap_m(door: VariedDoor) -> float:
    """By which a sliding leaf that runs in front of the wall covers it on each side."""
    return SLIDING_OVERLAP_M if door.leaf_recess_m < 0 else 0.0


def _sliding_leaf(door: VariedDoor) -> list[Box]:
    """Closed; with a bar on the face that never meets the wall, if the leaf runs in front of it."""
    overlap = _overlap_m(door)
    bottom = door.threshold_m + door.leaf_floor_gap_m
    height = door.opening_height_m + overlap - bottom
    width = door.opening_width_m + 2 * overlap
    y = -door.leaf_recess_m - door.leaf_thickness_m / 2
    slab = Box(Part.LEAF, (0.0, y, bottom + height / 2), (width, door.leaf_thickness_m, height))
    if door.handle is None:
        return [slab]
    grip = handle_boxes(door.handle, width, -door.leaf_recess_m, 1)
    return [slab, *place(grip, -width / 2, 0.0, 0.0)]
