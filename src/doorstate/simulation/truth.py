# SPDX-License-Identifier: Apache-2.0
"""Doors that a simulated frame shows: what an answer is compared with."""

from __future__ import annotations

from doorstate.errors import DatasetError
from doorstate.simulation.row import Row
from doorstate.simulation.true_door import TrueDoor, VisiblePixels

__all__ = ["TrueDoor", "VisiblePixels", "true_doors"]

_COLUMNS = {  # of the main door, by field of `TrueDoor`
    "x_m": "door_x_m",
    "y_m": "door_y_m",
    "yaw_deg": "door_yaw_deg",
    "floor_z_m": "door_z_m",
    "width_m": "opening_width_m",
    "height_m": "opening_height_m",
    "kind": "door_kind",
    "hinge": "hinge",
    "swing": "swing",
    "state": "state",
    "ambiguous": "ambiguous",
    "passable_width_m": "passable_width_m",
}
_OPTIONAL = ("opening_angle_deg", "passive_angle_deg", "opening_share")
DOOR_COLUMNS = (*_COLUMNS.values(), *_OPTIONAL)
"""Columns of `main_columns`."""


def true_doors(row: Row) -> tuple[TrueDoor, ...]:
    """Return the doors of a manifest row, first the main door; none for a scene without a door.

    Raises:
        DatasetError: a column of the main door is empty.
    """
    if row.scene.door is None:
        return ()
    return (_main_door(row), *(other.truth for other in row.other_doors))


def _main_door(row: Row) -> TrueDoor:
    values = {field: getattr(row, column) for field, column in _COLUMNS.items()}
    for field, value in values.items():
        if value is None:
            raise DatasetError(f"sample {row.sample_id} has a door, but no value", field=_COLUMNS[field])
    seen = VisiblePixels(leaf=row.visible_leaf_px, frame=row.visible_frame_px, opening=row.visible_opening_px)
    return TrueDoor(**values, **{name: getattr(row, name) for name in _OPTIONAL}, visible_px=seen)


def main_columns(door: TrueDoor) -> dict[str, object]:
    """Return the columns of a main door, without counts of pixels."""
    columns = {column: getattr(door, field) for field, column in _COLUMNS.items()}
    return columns | {name: getattr(door, name) for name in _OPTIONAL} | {"state": str(door.state)}
