# SPDX-License-Identifier: Apache-2.0
"""Stretches of time in which a door had one state, from the events of its history."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from doorstate.doors.sighting import NOT_SEEN
from doorstate.doors.tracker import DoorEvent


class StateInterval(NamedTuple):
    """A door was seen in one state from a time to another."""

    door: str
    state: str
    first_s: float
    last_s: float


def state_intervals(events: Iterable[DoorEvent], until_s: float) -> list[StateInterval]:
    """Return the intervals of all doors by their start, without those in which a door was not seen.

    Args:
        events: events of a history, by time.
        until_s: end of intervals that no event ends.
    """
    started: dict[str, tuple[str, float]] = {}
    intervals = []
    for event in events:
        state, first_s = started.pop(event.door, (NOT_SEEN, event.time_s))
        if state != NOT_SEEN and event.time_s > first_s:
            intervals.append(StateInterval(event.door, state, first_s, event.time_s))
        started[event.door] = event.to_state, event.time_s
    for door, (state, first_s) in started.items():
        if state != NOT_SEEN and until_s > first_s:
            intervals.append(StateInterval(door, state, first_s, until_s))
    return sorted(intervals, key=lambda interval: (interval.first_s, interval.door))
