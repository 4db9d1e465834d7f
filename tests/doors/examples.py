# SPDX-License-Identifier: Apache-2.0
"""Doors of lists and doors that cameras see, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.named_door import DoorPlace, NamedDoor
from doorstate.doors.plane_pose import PlanePose
from doorstate.inference.door import Door
from doorstate.types import STATES, DoorState

AT_ORIGIN = CameraPlace(PlanePose(0.0, 0.0, 0.0), position_error_m=0.05, yaw_error_deg=2.0)


def named(name: str, x_m: float, y_m: float, yaw_deg: float = 90.0, **fields: Any) -> NamedDoor:
    """A door of a list, by default in a wall straight ahead of a camera at the origin."""
    place = DoorPlace(x_m=x_m, y_m=y_m, yaw_deg=yaw_deg)
    return NamedDoor(id=name, pose=place, **{"width_m": 0.9} | fields)


def seen(x_m: float, y_m: float, yaw_deg: float = 90.0, state: str | None = "closed", **fields: Any) -> Door:
    """A door in the level sensor frame, with a sure state or none."""
    sure = {} if state is None else {name: 0.98 if name == state else 0.01 for name in STATES}
    values: dict[str, Any] = {
        "raw_probabilities": sure or None,
        "position_error_m": 0.05,
        "yaw_error_deg": 2.0,
    }
    return Door(x_m, y_m, yaw_deg, 0.9, None if state is None else DoorState(state), **values | fields)


def seen_from(camera: CameraPlace, door: NamedDoor, state: str | None = "closed", **fields: Any) -> Door:
    """The door of a list as a camera without any error sees it."""
    face = camera.pose.inverse().after(door.face_towards(camera.pose.x_m, camera.pose.y_m))
    return seen(*face, state, **fields)


def all_maps(count: int, names: tuple[int, ...]) -> Iterator[tuple[int | None, ...]]:
    """All ways to give each of some things one of the names or none, no name twice."""
    if count == 0:
        yield ()
        return
    for rest in all_maps(count - 1, names):
        yield (*rest, None)
        yield from ((*rest, name) for name in names if name not in rest)
