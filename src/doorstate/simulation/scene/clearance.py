# SPDX-License-Identifier: Apache-2.0
"""Clearances of a door: the width left for a robot, the angle left for the leaf, and what nothing may stand in."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from doorstate.simulation.scene.box import Box, mirror
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import fixed_boxes, frame_and_leaf_boxes, leaf_boxes, turn_leaf
from doorstate.simulation.scene.folding import folding_panels
from doorstate.simulation.scene.leaf import leaf_slab, leaf_widths_m, sliding_overlap_m
from doorstate.simulation.scene.plan import colliding, distance_m
from doorstate.types import Part

_WIDEST_DEG, _STEP_DEG = 170, 5


def passable_width_m(door: Door, opening: Opening) -> float:
    """Return the narrowest gap in plan that a robot must pass: from the active leaf to the opposite jamb.

    With a double door the opposite side is the passive leaf and its jamb, with two pairs of folding panels the other
    pair. Handles and fittings do not count. Nothing passes a revolving door that stands still: 0.
    """
    width = door.opening_width_m
    if door.kind == "revolving":
        return 0.0
    if door.kind == "sliding_double":  # the leaves cover the wall at their outer edges only
        return opening.share * width
    if door.is_sliding:
        return max(0.0, opening.share * width - sliding_overlap_m(door))
    jamb_m = door.jamb_thickness_m or door.wall_thickness_m
    jamb = Box(
        Part.FRAME,
        (width / 2 + jamb_m / 2, -door.wall_thickness_m / 2, 1.0),
        (jamb_m, door.wall_thickness_m, 2.0),
    )
    if door.kind == "folding":
        bare = door.model_copy(update={"handle": None, "fittings": None, "glass_panels": None})
        panels = [panel for (panel,) in folding_panels(bare, opening.share)]
        opposite = [jamb] if len(panels) == 2 else panels[2:]
        return min(width, *(distance_m(panel, other) for panel in panels[:2] for other in opposite))
    active_m, passive_m = leaf_widths_m(door)
    (active,) = turn_leaf(door, [leaf_slab(door, active_m)], opening.angle_deg)
    gaps = [width, distance_m(active, jamb)]
    if door.is_double:
        (passive,) = mirror(turn_leaf(door, [leaf_slab(door, passive_m)], opening.passive_angle_deg), x=True)
        gaps += [distance_m(active, passive), distance_m(passive, mirror([jamb], x=True)[0])]
    return min(gaps)


def free_angle_deg(door: Door, obstacles: list[Box]) -> int:
    """Return the angle, up to 170 degrees in steps of 5, by which the leaves turn until they hit something fixed."""
    angles_deg = range(_STEP_DEG, _WIDEST_DEG + 1, _STEP_DEG)
    turned = [leaf_boxes(door, Opening(angle_deg=angle, passive_angle_deg=angle)) for angle in angles_deg]
    hits = colliding([*chain.from_iterable(turned)], [*fixed_boxes(door), *obstacles])
    angle_of_box = np.repeat(angles_deg, [len(boxes) for boxes in turned])
    return int(angle_of_box[hits].min(initial=_WIDEST_DEG + _STEP_DEG)) - _STEP_DEG


def keep_out_boxes(door: Door, openings: Sequence[Opening]) -> list[Box]:
    """Return boxes in the door frame that cameras and furniture stay out of.

    These are the frame, the leaves when closed and at each opening, and the whole drum of a revolving door.
    """
    moved = chain.from_iterable(leaf_boxes(door, opening) for opening in openings)
    boxes = [*frame_and_leaf_boxes(door, Opening()), *moved]
    if door.kind == "revolving":
        side, height = door.opening_width_m + 2 * door.jamb_thickness_m, door.opening_height_m
        boxes.append(Box(Part.FRAME, (0.0, -door.wall_thickness_m / 2, height / 2), (side, side, height)))
    return boxes
