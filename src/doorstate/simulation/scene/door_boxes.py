# SPDX-License-Identifier: Apache-2.0
"""Boxes of a door for one opening, in the door frame.

A door is built with the hinge on the right and the leaf towards the robot, then mirrored to its hinge and swing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain

from doorstate.simulation.scene.box import Box, mirror, place
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.folding import folding_panels
from doorstate.simulation.scene.frame import frame_boxes
from doorstate.simulation.scene.leaf import hinged_leaf, leaf_widths_m, sliding_leaf
from doorstate.simulation.scene.revolving import revolving_wings
from doorstate.simulation.scene.wall import Gap, door_gap, wall_boxes


def door_boxes(
    door: Door, opening: Opening, neighbours: Sequence[Gap] = (), ends_m: tuple[float, float] | None = None
) -> list[Box]:
    """Return wall, frame and leaves; the wall comes first and the leaves last."""
    return [*fixed_boxes(door, neighbours, ends_m), *leaf_boxes(door, opening)]


def fixed_boxes(
    door: Door, neighbours: Sequence[Gap] = (), ends_m: tuple[float, float] | None = None
) -> list[Box]:
    """Return the parts that do not move: wall, frame, threshold, track and drum.

    Args:
        door: door in its wall.
        neighbours: gaps of other doors in the same wall.
        ends_m: ends of the wall along x; None is the door's own.
    """
    low, high = ends_m or (-door.wall_half_length_m, door.wall_half_length_m)
    sign = -1.0 if door.hinge == "left" else 1.0
    ends_m = (low, high) if sign > 0 else (-high, -low)
    gaps = [door_gap(door), *(gap._replace(x_m=sign * gap.x_m) for gap in neighbours)]
    wall = wall_boxes(ends_m, door.wall_thickness_m, door.wall_height_m, gaps)
    return [*_to_hinge_and_swing(wall, door), *_frame_boxes(door)]


def frame_and_leaf_boxes(door: Door, opening: Opening) -> list[Box]:
    """Return a door without its wall; the leaves come last."""
    return [*_frame_boxes(door), *leaf_boxes(door, opening)]


def leaf_boxes(door: Door, opening: Opening) -> list[Box]:
    """Return the leaves with their fittings and handles."""
    if door.is_sliding:
        return _to_hinge_and_swing(_sliding_leaves(door, opening.share), door)
    if door.kind == "folding":
        return _to_hinge_and_swing(list(chain.from_iterable(folding_panels(door, opening.share))), door)
    if door.kind == "revolving":
        return _to_hinge_and_swing(revolving_wings(door, opening.share), door)
    active_m, passive_m = leaf_widths_m(door)
    boxes = turn_leaf(door, hinged_leaf(door, active_m, door.handle), opening.angle_deg)
    if door.is_double:
        passive = hinged_leaf(door, passive_m, None)
        boxes += mirror(turn_leaf(door, passive, opening.passive_angle_deg), x=True)
    return _to_hinge_and_swing(boxes, door)


def _sliding_leaves(door: Door, share: float) -> list[Box]:
    leaf = sliding_leaf(door)
    if door.kind == "sliding":
        return place(leaf, -share * door.opening_width_m, 0.0, 0.0)
    leaf = place(leaf, -share * door.opening_width_m / 2, 0.0, 0.0)
    return [*leaf, *mirror(leaf, x=True)]


def turn_leaf(door: Door, leaf: list[Box], angle_deg: float) -> list[Box]:
    """Move boxes from a leaf's frame to the door frame, for a hinge on the right and a swing towards the robot."""
    x = -door.opening_width_m / 2 + door.leaf_gap_m
    return place(leaf, x, door.hinge_offset_m - door.leaf_recess_m, math.radians(angle_deg))


def _frame_boxes(door: Door) -> list[Box]:
    return _to_hinge_and_swing([box for box in frame_boxes(door) if min(box.size_m) > 0], door)


def _to_hinge_and_swing(boxes: list[Box], door: Door) -> list[Box]:
    middle = -door.wall_thickness_m / 2
    return mirror(boxes, x=door.hinge == "left", about_y_m=middle if door.swing == "away" else None)
