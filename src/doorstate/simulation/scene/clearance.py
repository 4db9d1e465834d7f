# SPDX-License-Identifier: Apache-2.0
"""Clearances of a door: the width left for a robot, and the angle left for the leaf."""

from __future__ import annotations

from doorstate.simulation.scene.box import Box, mirror
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import fixed_boxes, leaf_boxes, turn_leaf
from doorstate.simulation.scene.leaf import leaf_slab, leaf_widths_m, sliding_overlap_m
from doorstate.simulation.scene.plan import collide, distance_m
from doorstate.types import Part

_WIDEST_DEG, _STEP_DEG = 170, 5


def passable_width_m(door: Door, opening: Opening) -> float:
    """Return the narrowest gap in plan that a robot must pass: from the active leaf to the opposite jamb.

    With a double door the opposite side is the passive leaf and its jamb. Handles do not count.
    """
    width = door.opening_width_m
    if door.is_sliding:
        return max(0.0, opening.share * width - sliding_overlap_m(door))
    jamb = Box(
        Part.FRAME,
        (width / 2 + door.jamb_thickness_m / 2, -door.wall_thickness_m / 2, 1.0),
        (door.jamb_thickness_m, door.wall_thickness_m, 2.0),
    )
    active_m, passive_m = leaf_widths_m(door)
    (active,) = turn_leaf(door, [leaf_slab(door, active_m)], opening.angle_deg)
    gaps = [width, distance_m(active, jamb)]
    if door.is_double:
        (passive,) = mirror(turn_leaf(door, [leaf_slab(door, passive_m)], opening.passive_angle_deg), x=True)
        gaps += [distance_m(active, passive), distance_m(passive, mirror([jamb], x=True)[0])]
    return min(gaps)


def free_angle_deg(door: Door, obstacles: list[Box]) -> int:
    """Return the angle, up to 170 degrees in steps of 5, by which the leaves turn until they hit something fixed."""
    fixed = [*fixed_boxes(door), *obstacles]
    for angle in range(_STEP_DEG, _WIDEST_DEG + 1, _STEP_DEG):
        if collide(leaf_boxes(door, Opening(angle_deg=angle, passive_angle_deg=angle)), fixed):
            return angle - _STEP_DEG
    return _WIDEST_DEG
