# SPDX-License-Identifier: Apache-2.0
"""Waiting for a state of a door, as the action WaitForDoor does. Needs no ROS."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from doorstate_nav.memory import CLOSED, OPEN, STATES, UNKNOWN, DoorMemory, KnownDoor


class Progress(NamedTuple):
    """State of a wait: while it lasts, and at its end."""

    state: int
    held_s: float  # for which the wanted state has held
    silent_s: float  # since the door last had a state
    reason: str  # why the wanted state does not count now
    reached: bool | None  # None: go on waiting


class DoorWait:
    """One wait.

    Args:
        goal: goal of WaitForDoor.
        now_s: start on a steady clock.

    Raises:
        ValueError: an impossible goal.
    """

    def __init__(self, goal: Any, now_s: float) -> None:
        if not CLOSED <= goal.state <= OPEN:
            raise ValueError(f"state {goal.state}: expected 1 (closed), 2 (semi-open) or 3 (open)")
        for name in ("timeout_s", "hold_s", "min_probability", "min_passable_width_m"):
            value = getattr(goal, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} {value}: expected a number that is not negative")
        self._goal, self._started_s = goal, now_s
        self._since_s: float | None = None  # arrival of the message from which on the wanted state has held
        self._state_s = now_s

    def step(self, memory: DoorMemory, now_s: float) -> Progress:
        """Return what is known now.

        Args:
            memory: newest state of all doors.
            now_s: time on the same clock.
        """
        door = memory.at(self._goal.door, now_s)
        if door.state != UNKNOWN:
            self._state_s = now_s
        reason = self._why_not(door)
        if reason:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = door.taken_s
        # Only messages tell that a state holds, silence does not.
        held_s = 0.0 if self._since_s is None else door.taken_s - self._since_s
        reached: bool | None = None
        if self._since_s is not None and held_s >= self._goal.hold_s:
            reached = True
        elif self._goal.timeout_s and now_s - self._started_s >= self._goal.timeout_s:
            reached, reason = False, f"timed out: {reason or 'it did not hold for long enough'}"
        return Progress(door.state, held_s, now_s - self._state_s, reason, reached)

    def _why_not(self, door: KnownDoor) -> str:
        """Return why a door is not as it is wanted; empty if it is."""
        goal = self._goal
        if door.state == UNKNOWN:
            return door.reason
        if door.state != goal.state:
            return f"the door is {STATES[door.state]}"
        if not door.probability >= goal.min_probability and not math.isnan(door.probability):
            return f"unsure: probability {door.probability:.2f}"
        if goal.state == OPEN and goal.require_leaf and not door.leaf_seen:
            return "no leaf was seen: it may be glass"
        if goal.min_passable_width_m and not door.passable_width_m >= goal.min_passable_width_m:
            return f"passable width {door.passable_width_m:.2f} m"
        return ""
