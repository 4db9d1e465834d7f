# SPDX-License-Identifier: Apache-2.0
"""Doors that a simulated frame shows, as they are: what an answer is compared with."""

from __future__ import annotations

from typing import NamedTuple

from doorstate.errors import DatasetError
from doorstate.simulation.row import Row
from doorstate.types import DoorState


class VisiblePixels(NamedTuple):
    """Pixels that see the parts of one door."""

    leaf: int
    frame: int
    opening: int  # through the opening, at nothing in front of it


class TrueDoor(NamedTuple):
    """A door in the level sensor frame, its state and its sizes."""

    x_m: float  # origin of the door frame: middle of the opening, on the robot's face of the wall
    y_m: float
    yaw_deg: float  # direction of the door frame's x axis; 90 for a wall straight ahead
    floor_z_m: float
    width_m: float
    height_m: float
    state: DoorState
    opening_angle_deg: float | None  # of the active leaf; None for a sliding door
    hinge: str  # left or right; empty for a sliding door
    passable_width_m: float
    visible_px: VisiblePixels


def true_doors(row: Row) -> tuple[TrueDoor, ...]:
    """Return the doors of a manifest row, first the main door; none for a scene without a door.

    Raises:
        DatasetError: a column of the door is empty.
    """
    if row.scene.door is None:
        return ()
    return (_main_door(row),)


def _main_door(row: Row) -> TrueDoor:
    return TrueDoor(
        x_m=_number(row, "door_x_m"),
        y_m=_number(row, "door_y_m"),
        yaw_deg=_number(row, "door_yaw_deg"),
        floor_z_m=_number(row, "door_z_m"),
        width_m=_number(row, "opening_width_m"),
        height_m=_number(row, "opening_height_m"),
        state=DoorState(row.state),
        opening_angle_deg=row.opening_angle_deg,
        hinge=row.hinge,
        passable_width_m=_number(row, "passable_width_m"),
        visible_px=VisiblePixels(row.visible_leaf_px, row.visible_frame_px, row.visible_opening_px),
    )


def _number(row: Row, column: str) -> float:
    value: float | None = getattr(row, column)
    if value is None:
        raise DatasetError(f"sample {row.sample_id} has a door, but no value", field=column)
    return value
