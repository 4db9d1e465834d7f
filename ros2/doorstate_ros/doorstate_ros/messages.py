# SPDX-License-Identifier: Apache-2.0
"""Messages about doors, made of reports."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, Quaternion
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker

from doorstate.doors.sighting import Sighting
from doorstate.doors.tracker import TrackedFrame
from doorstate.inference.door import Door
from doorstate.inference.door_report import UNKNOWN, DoorPose, DoorReport
from doorstate.types import STATES

COLOURS = {
    "closed": (0.84, 0.15, 0.16),
    "semi_open": (1.0, 0.6, 0.1),
    "open": (0.17, 0.63, 0.17),
    UNKNOWN: (0.6, 0.6, 0.6),
}
TEXT_HEIGHT_M = 0.15
LINE_WIDTH_M, PASSAGE_WIDTH_M = 0.02, 0.05
_LARGE = 1e6  # variance of what is not measured


def stamp(stamp_ns: int) -> Time:
    return Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def point(place_m: Iterable[float]) -> Point:
    x, y, z = (float(metres) for metres in place_m)
    return Point(x=x, y=y, z=z)


def pose(door: DoorPose) -> Pose:
    x, y, z, w = door.quaternion
    return Pose(position=point(door.position_m), orientation=Quaternion(x=x, y=y, z=z, w=w))


def diagnostic(name: str, report: DoorReport, level: bytes, tracked: TrackedFrame | None) -> DiagnosticStatus:
    """Return the status of a report, with a value for each door of a list."""
    values = report.values
    for sighting in () if tracked is None else tracked.sightings:
        values[f"door/{sighting.id}"] = sighting.reason() if sighting.state is None else str(sighting.state)
    return DiagnosticStatus(
        level=level,
        name=f"{name}: door",
        message=report.prediction.reason or values["raw_state"],
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def markers(header: Header, report: DoorReport, lifetime: Duration) -> list[Marker]:
    """Return a label, the detections of a rule, and frame, leaf and passage of the doors.

    They replace all earlier markers.
    """
    common = {"header": header, "color": _colour(report.state), "lifetime": lifetime}
    label = _text("state", 0, report.text, report.centre_m, common)
    drawn = [Marker(header=header, action=Marker.DELETEALL), label]
    for number, detection in enumerate(report.detections):
        drawn.append(_lines(detection.name, number, detection.points_m, LINE_WIDTH_M, common))
    for number, line in enumerate(report.lines):
        drawn.append(_lines(f"doors/{line.name}", number, line.points_m, LINE_WIDTH_M, common))
        if line.label:
            drawn.append(_text("doors/label", number, line.label, line.points_m[-1], common))
    for number, (door, place) in enumerate(zip(report.prediction.doors, report.poses, strict=True)):
        drawn += _passage(number, door, place, common)
    return drawn


def _passage(number: int, door: Door, place: DoorPose, common: dict[str, Any]) -> list[Marker]:
    """Return a line on the floor as long as the passable width, from the jamb opposite the hinge, and its length."""
    free_m = door.passable_width_m
    if free_m is None or door.state is None or free_m <= 0:
        return []
    x, y, z, w = place.quaternion
    along = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))  # x axis of the doorway
    # x of the doorway runs to its left, seen from the camera; the leaf takes the side of its hinge.
    side = -1.0 if door.hinge == "left" else 1.0
    ends = [side * door.width_m / 2, side * (door.width_m / 2 - free_m)]
    line_m = [
        [at + along_m * metres for at, along_m in zip(place.position_m, along, strict=True)]
        for metres in ends
    ]
    middle_m = [(first + last) / 2 for first, last in zip(*line_m, strict=True)]
    passage = {**common, "color": _colour(str(door.state))}
    return [
        _lines("doors/passage", number, line_m, PASSAGE_WIDTH_M, passage),
        _text("doors/passage width", number, f"{free_m:.2f} m", middle_m, passage),
    ]


def _lines(name: str, number: int, places_m: Any, width_m: float, common: dict[str, Any]) -> Marker:
    lines = Marker(ns=name, id=number, type=Marker.LINE_STRIP, **common)
    lines.scale.x = width_m
    lines.points = [point(place_m) for place_m in places_m]
    return lines


def _text(name: str, number: int, text: str, place_m: Iterable[float], common: dict[str, Any]) -> Marker:
    marker = Marker(ns=name, id=number, type=Marker.TEXT_VIEW_FACING, text=text, **common)
    marker.scale.z = TEXT_HEIGHT_M
    marker.pose.position = point(place_m)
    return marker


def _colour(state: str) -> ColorRGBA:
    red, green, blue = COLOURS[state]
    return ColorRGBA(r=red, g=green, b=blue, a=1.0)


def door_messages(kind: Any, report: DoorReport, tracked: TrackedFrame | None) -> list[Any]:
    """Return a `doorstate_msgs/Door` for each door of a report, and for each door of a list that it does not show.

    Args:
        kind: class of the message.
        report: report.
        tracked: doors of a list; None without one.
    """
    names = (None,) * len(report.prediction.doors) if tracked is None else tracked.names
    sightings = {} if tracked is None else {sighting.id: sighting for sighting in tracked.sightings}
    messages = []
    for door, place, name in zip(report.prediction.doors, report.poses, names, strict=True):
        sighting = None if name is None else sightings.pop(name)
        messages.append(_seen(kind, door if sighting is None else sighting.door or door, place, sighting))
    return messages + [_listed(kind, sighting) for sighting in sightings.values()]


def _seen(kind: Any, door: Door, place: DoorPose, sighting: Sighting | None) -> Any:
    message = kind() if sighting is None else _listed(kind, sighting)
    message.seen = True
    message.state = _number(door.state)
    message.reason = "" if door.abstention is None else str(door.abstention)
    probabilities = door.probabilities or {}
    message.probability = _or_nan(door.probability)
    message.probabilities = [_or_nan(probabilities.get(state)) for state in STATES]
    message.opening_angle_deg = _or_nan(door.opening_angle_deg)
    message.angle_error_deg = _or_nan(door.angle_error_deg)
    message.hinge = door.hinge or ""
    message.leaf_seen = bool(door.leaf_seen)
    message.pose.pose = pose(place)
    message.pose.covariance = _covariance(door)
    message.width_m = float(door.width_m)
    message.passable_width_m = _or_nan(door.passable_width_m)
    message.distance_m = float(door.distance_m)
    return message


def _listed(kind: Any, sighting: Sighting) -> Any:
    """Return the message of a door of a list as far as the list and earlier clouds tell it."""
    message = kind(id=sighting.id, seen=sighting.is_seen, reason=sighting.reason())
    message.filtered_state = _number(None if sighting.filtered is None else sighting.filtered.state)
    for name in ("probability", "opening_angle_deg", "angle_error_deg", "passable_width_m"):
        setattr(message, name, math.nan)
    message.probabilities = [math.nan] * len(STATES)
    message.last_state = _number(sighting.last_state)
    if sighting.last_seen_s is not None:
        message.last_seen = stamp(round(sighting.last_seen_s * 1e9))
    return message


def _covariance(door: Door) -> Sequence[float]:
    """Return the covariance of x, y, z and the turns about them, row by row; what is not measured varies widely."""
    position, yaw = door.position_error_m, door.yaw_error_deg
    place = _LARGE if position is None else position**2
    turn = _LARGE if yaw is None else math.radians(yaw) ** 2
    diagonal = (place, place, _LARGE, _LARGE, _LARGE, turn)
    return [value if row == column else 0.0 for row, value in enumerate(diagonal) for column in range(6)]


def _number(state: str | None) -> int:
    """Return the constant of Door.msg."""
    return 0 if state is None else 1 + STATES.index(str(state))


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)
