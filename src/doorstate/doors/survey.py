# SPDX-License-Identifier: Apache-2.0
"""Doors for a list from clouds whose camera poses are known: sightings of one place are one door."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import median
from typing import NamedTuple, TypeVar

from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.door_file import overlap
from doorstate.doors.named_door import DoorPlace, NamedDoor
from doorstate.doors.plane_pose import PlanePose, turned_deg
from doorstate.inference.door import Door

Value = TypeVar("Value")
_MIN_PROBABILITY = 0.5  # of a door that is entered in a list
_MIN_HINGE_PROBABILITY = 0.7
_USUAL_M, _USUAL_DEG = 0.15, 6.0


class MappedDoor(NamedTuple):
    """A door that was seen, in the map."""

    place: PlanePose  # of the face that the camera saw
    width_m: float
    hinge: str | None
    frame: str
    variance_m2: float  # of x, and of y

    def as_named(self) -> NamedDoor:
        """Return the door as one of a list, without its name."""
        return _named("seen", self.frame, self.place, self.width_m, None)


def map_doors(doors: Iterable[Door], camera: CameraPlace) -> list[MappedDoor]:
    """Return the likely doors of a cloud in the map."""
    return [
        _mapped(door, camera)
        for door in doors
        if door.door_probability is None or door.door_probability >= _MIN_PROBABILITY
    ]


def survey_doors(
    seen: Sequence[MappedDoor], known: Sequence[NamedDoor], min_views: int = 1, name: str = "door"
) -> list[NamedDoor]:
    """Return doors that are not in a list yet, in the order of their first sight.

    Place, direction and width are weighted means and medians of all sights from the side of the first; the hinge is
    that of most sights that show one.

    Args:
        seen: doors of all clouds.
        known: doors of the list.
        min_views: sights that a door needs.
        name: beginning of the new names, which are numbered.
    """
    groups: list[list[MappedDoor]] = []
    for door in seen:
        if any(overlap(door.as_named(), other) for other in known):
            continue
        group = next((group for group in groups if overlap(door.as_named(), _mean(group, "mean"))), None)
        if group is None:
            groups.append([door])
        else:
            group.append(door)
    names = (f"{name}-{number}" for number in range(1, len(groups) + len(known) + 1))
    taken = {door.id.casefold() for door in known}
    free = (text for text in names if text.casefold() not in taken)
    kept = [group for group in groups if len(group) >= min_views]
    new: list[NamedDoor] = []
    for group in kept:
        mean = _mean(group, "mean")
        if not any(overlap(mean, other) for other in (*known, *new)):
            new.append(mean.model_copy(update={"id": next(free)}))
    return new


def _mapped(door: Door, camera: CameraPlace) -> MappedDoor:
    error_m = _USUAL_M if door.position_error_m is None else door.position_error_m
    turned_m = door.distance_m * math.radians(camera.yaw_error_deg)
    is_sure = door.hinge_probability is None or door.hinge_probability >= _MIN_HINGE_PROBABILITY
    return MappedDoor(
        camera.pose.after(PlanePose(door.x_m, door.y_m, door.yaw_deg)),
        min(max(door.width_m, 0.4), 6.0),
        door.hinge if is_sure else None,
        camera.frame,
        error_m**2 + camera.position_error_m**2 + turned_m**2,
    )


def _mean(group: Sequence[MappedDoor], name: str) -> NamedDoor:
    first = group[0].place
    # Those from behind are of another face of the wall, and have the hinge on the other side.
    front = [door for door in group if abs(turned_deg(door.place.yaw_deg - first.yaw_deg)) <= 90]
    weights = [1 / max(1e-6, door.variance_m2) for door in front]
    x_m, y_m, turn_deg = (
        sum(weight * value for weight, value in zip(weights, values, strict=True)) / sum(weights)
        for values in (
            [door.place.x_m for door in front],
            [door.place.y_m for door in front],
            [turned_deg(door.place.yaw_deg - first.yaw_deg) for door in front],
        )
    )
    place = PlanePose(x_m, y_m, turned_deg(first.yaw_deg + turn_deg))
    hinges = [door.hinge for door in front if door.hinge is not None]
    return _named(name, group[0].frame, place, median(door.width_m for door in front), _most(hinges))


def _named(name: str, frame: str, place: PlanePose, width_m: float, hinge: str | None) -> NamedDoor:
    x_m, y_m, yaw_deg = place
    return NamedDoor(
        id=name,
        frame=frame,
        pose=DoorPlace(x_m=round(x_m, 3), y_m=round(y_m, 3), yaw_deg=round(yaw_deg, 1)),
        width_m=round(width_m, 2),
        hinge=hinge,  # type: ignore[arg-type]
    )


def _most(values: Sequence[Value]) -> Value | None:
    """Return the value that more than half of all are."""
    if not values:
        return None
    value, count = Counter(values).most_common(1)[0]
    return value if 2 * count > len(values) else None
