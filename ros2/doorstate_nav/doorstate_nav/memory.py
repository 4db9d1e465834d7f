# SPDX-License-Identifier: Apache-2.0
"""Newest state of each door by `doorstate_msgs/Doors`; an old state is no state. Needs no ROS.

Ages are those of a steady clock, from the arrival of the message, so that a clock that is set neither keeps nor loses a
state. A message whose cloud is much older than the one before, such as the first of a recording that begins again,
forgets all doors.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

UNKNOWN, CLOSED, SEMI_OPEN, OPEN = range(4)  # constants of Door.msg
STATES = ("unknown", "closed", "semi_open", "open")
EXPIRE_S = 2.0
_BACK_S = 1.0  # by which stamps of several cameras may differ; clocks and recordings go back by more
FRONT = ""  # the door most in front, where doors have no names


class KnownDoor(NamedTuple):
    """A door as the newest message shows it."""

    state: int = UNKNOWN  # by the filter for a door of a list, else of the cloud alone
    probability: float = math.nan
    passable_width_m: float = math.nan
    leaf_seen: bool = False
    reason: str = "never seen"
    taken_s: float = -math.inf  # arrival of that message


NEVER_SEEN = KnownDoor()


class DoorMemory:
    """Doors of the newest messages.

    Args:
        expire_s: time after which a state counts no more.
    """

    def __init__(self, expire_s: float = EXPIRE_S) -> None:
        self._expire_s = expire_s
        self._doors: dict[str, KnownDoor] = {}
        self._updated_s = -math.inf
        self._stamp_s = -math.inf

    def update(self, message: Any, now_s: float) -> None:
        """Take a `doorstate_msgs/Doors`.

        Args:
            message: message.
            now_s: time on a steady clock.
        """
        stamp = message.header.stamp
        stamp_s = stamp.sec + stamp.nanosec / 1e9
        if stamp_s < self._stamp_s - _BACK_S:
            self._doors.clear()
            self._stamp_s = stamp_s
        self._stamp_s, self._updated_s = max(stamp_s, self._stamp_s), now_s
        for door in message.doors:
            if door.id:
                self._doors[door.id] = _known(door)._replace(taken_s=now_s)
        seen = [door for door in message.doors if door.seen]
        front = _known(seen[0]) if seen else KnownDoor(reason=message.reason or "no door is in view")
        self._doors[FRONT] = front._replace(taken_s=now_s)

    def silent_s(self, now_s: float) -> float:
        """Return the time since the last message; infinite before the first."""
        return now_s - self._updated_s

    def at(self, door: str, now_s: float) -> KnownDoor:
        """Return a door now: unknown with the reason where its state is too old."""
        known = self._doors.get(door)
        if known is None:
            return NEVER_SEEN
        age_s = now_s - known.taken_s
        if age_s < self._expire_s:
            return known
        return KnownDoor(reason=f"no word of this door for {age_s:.1f} s")


def _known(door: Any) -> KnownDoor:
    state = door.filtered_state if door.id else door.state
    if not door.seen or state == UNKNOWN:
        return KnownDoor(reason=door.reason or "not seen for long enough")
    return KnownDoor(state, door.probability, door.passable_width_m, door.leaf_seen, "")
