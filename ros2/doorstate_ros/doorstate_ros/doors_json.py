# SPDX-License-Identifier: Apache-2.0
"""Text of the topic `doors`."""

from __future__ import annotations

import json

from doorstate.doors.sighting import UNKNOWN_DOOR
from doorstate.doors.tracker import TrackedFrame
from doorstate.inference.door_report import DoorReport


def doors_json(report: DoorReport, tracked: TrackedFrame | None) -> str:
    """Return the doors of a report as a JSON list, with their names where there is a list of doors.

    Doors of that list that the cloud does not show follow, with `seen` false and a reason.
    """
    doors = json.loads(report.doors)
    if tracked is None:
        return json.dumps(doors)
    named = [
        {"name": name or UNKNOWN_DOOR, "seen": True} | door
        for name, door in zip(tracked.names, doors, strict=True)
    ]
    hidden = [
        {"name": sighting.id, "seen": False, "state": None, "reason": sighting.reason()}
        for sighting in tracked.sightings
        if not sighting.is_seen
    ]
    return json.dumps(named + hidden)
