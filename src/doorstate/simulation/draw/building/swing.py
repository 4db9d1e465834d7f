# SPDX-License-Identifier: Apache-2.0
"""Openings of the doors of a plan, and the space that their leaves need."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from doorstate.simulation.draw.building.plan import Plan
from doorstate.simulation.draw.layouts import WallDoor
from doorstate.simulation.draw.openings import draw_openings
from doorstate.simulation.draw.scenes import LEAST_FREE_DEG, solid
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.scene.box import Box
from doorstate.simulation.scene.clearance import keep_out_boxes
from doorstate.simulation.scene.door import Door, Opening
from doorstate.simulation.scene.door_boxes import fixed_boxes, frame_and_leaf_boxes, leaf_boxes
from doorstate.simulation.scene.plan import collide, colliding
from doorstate.simulation.scene.scene import BoxGroups
from doorstate.types import Part

_CHECKED_DEG = (20, 35, 50, 65, 80, 92, 104, 115, 130, 150, 170)
_SWEPT_STEPS = 3  # of the way to the widest opening; furniture keeps clear of the leaf there too


def draw_door_openings(stream: Stream, plan: Plan, groups: BoxGroups) -> list[list[Opening]] | None:
    """Draw an opening of each state for each door of a plan; None if a leaf cannot turn.

    Args:
        stream: random numbers.
        plan: the room.
        groups: its boxes with all doors closed, in the frame of the layout.
    """
    fixed = [groups.main, *groups.other_doors]
    walls = solid(groups.room)
    openings = []
    for number, placed in enumerate(plan.layout.doors):
        around = [*walls, *chain.from_iterable(fixed[:number] + fixed[number + 1 :])]
        if _is_in_pocket(placed.door):
            # Its leaves slide inside of the wall.
            around = [box for box in around if box.part is not Part.WALL]
        frame = plan.layout.door_frame(number)
        free_deg = _turning_deg(placed.door, frame.inverse().place(around))
        if free_deg < LEAST_FREE_DEG or not _has_pocket(plan, placed):
            return None
        openings.append(draw_openings(stream, placed.door, free_deg))
    return None if _leaves_meet(plan, openings) else openings


def swept_boxes(plan: Plan, openings: Sequence[Sequence[Opening]]) -> list[Box]:
    """Return what furniture and cameras stay out of: the leaves of all doors at all openings, and on their way."""
    boxes = []
    for number, placed in enumerate(plan.layout.doors):
        own = [*openings[number], *_on_the_way(openings[number])]
        boxes += plan.layout.door_frame(number).place(keep_out_boxes(placed.door, own))
    return boxes


def _on_the_way(openings: Sequence[Opening]) -> list[Opening]:
    shares = [step / _SWEPT_STEPS for step in range(1, _SWEPT_STEPS)]
    angle = max(opening.angle_deg for opening in openings)
    passive = max(opening.passive_angle_deg for opening in openings)
    way = max(opening.share for opening in openings)
    return [
        Opening(angle_deg=share * angle, passive_angle_deg=share * passive, share=share * way)
        for share in shares
    ]


def _leaves_meet(plan: Plan, openings: Sequence[Sequence[Opening]]) -> bool:
    """Return True if leaves of two doors can touch."""
    moved: list[Box] = []
    for number, placed in enumerate(plan.layout.doors):
        leaves = chain.from_iterable(leaf_boxes(placed.door, opening) for opening in openings[number])
        boxes = plan.layout.door_frame(number).place(list(leaves))
        if collide(boxes, moved):
            return True
        moved += boxes
    return False


def _is_in_pocket(door: Door) -> bool:
    return door.is_sliding and door.leaf_recess_m >= 0


def _has_pocket(plan: Plan, placed: WallDoor) -> bool:
    """Return True if the wall beside a door is long enough for leaves that slide into it; other doors need none."""
    door = placed.door
    if not _is_in_pocket(door):
        return True
    half = door.opening_width_m / 2
    if door.kind == "sliding":
        left, right = (3 * half, half) if door.hinge == "left" else (half, 3 * half)
    else:
        left = right = 2 * half
    low, high = placed.along_m - right, placed.along_m + left
    return (
        low >= 0
        and high <= plan.layout.wall_length_m(placed.wall)
        and not any(
            one.along_m + one.half_m > low and one.along_m - one.half_m < high
            for one in plan.openings(placed.wall)
            if one is not placed
        )
    )


def _turning_deg(door: Door, around: list[Box]) -> float:
    """Return the free angle as `turning_deg` does, from a few angles that are checked together."""
    if door.opens_by_share:
        moved = frame_and_leaf_boxes(door, Opening(share=1.0))
        return 0.0 if collide(moved, around) else 180.0
    bare = door.model_copy(update={"fittings": None})
    leaves = [leaf_boxes(bare, Opening(angle_deg=angle, passive_angle_deg=angle)) for angle in _CHECKED_DEG]
    hit = colliding(list(chain.from_iterable(leaves)), [*fixed_boxes(door), *around])
    if not hit.any():
        return _CHECKED_DEG[-1]
    first = int(hit.argmax()) // len(leaves[0])
    return 0.0 if first == 0 else _CHECKED_DEG[first - 1]
