# SPDX-License-Identifier: Apache-2.0
"""Modes of rmf_door_msgs/DoorMode. Needs no ROS.

An Open-RMF adapter of a door without a drive: it tells the state and opens nothing. Source:
https://github.com/open-rmf/rmf_internal_msgs/blob/main/rmf_door_msgs/msg/DoorMode.msg
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from doorstate_nav.memory import CLOSED, OPEN, SEMI_OPEN, DoorMemory

MODE_CLOSED, MODE_MOVING, MODE_OPEN, MODE_OFFLINE, MODE_UNKNOWN = range(5)
SemiOpen: TypeAlias = Literal["moving", "closed", "open", "unknown"]
_SEMI_OPEN = {"moving": MODE_MOVING, "closed": MODE_CLOSED, "open": MODE_OPEN, "unknown": MODE_UNKNOWN}


def door_mode(
    memory: DoorMemory,
    door: str,
    now_s: float,
    *,
    semi_open: SemiOpen = "moving",
    require_leaf: bool = True,
    silence_s: float = 5.0,
) -> int:
    """Return the mode of a door: offline in silence, unknown without a state.

    Args:
        memory: newest state of all doors.
        door: id of the door.
        now_s: time on the clock of the memory.
        semi_open: what a semi-open door is.
        require_leaf: an open door without a visible leaf, which may be glass, is unknown.
        silence_s: time without a message after which the door is offline.
    """
    if memory.silent_s(now_s) >= silence_s:
        return MODE_OFFLINE
    known = memory.at(door, now_s)
    if known.state == OPEN and require_leaf and not known.leaf_seen:
        return MODE_UNKNOWN
    if known.state == SEMI_OPEN:
        return _SEMI_OPEN[semi_open]
    return {OPEN: MODE_OPEN, CLOSED: MODE_CLOSED}.get(known.state, MODE_UNKNOWN)
