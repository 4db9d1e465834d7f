# SPDX-License-Identifier: Apache-2.0
"""Stand-ins of doorstate_msgs, which is built nowhere in these tests, with the fields of their definitions."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

from tests.ros2.package import ROS2

DEFINITION = (ROS2 / "doorstate_msgs" / "msg" / "Door.msg").read_text(encoding="utf-8")
FIELDS = re.findall(r"^[\w/]+(?:\[\d*\])? +([a-z]\w*)", DEFINITION, flags=re.MULTILINE)
CONSTANTS = {
    name: int(value) for name, value in re.findall(r"^uint8 ([A-Z_]+)=(\d)", DEFINITION, flags=re.MULTILINE)
}


class DoorMessage(SimpleNamespace):
    """Door with the fields of the definition and no others."""

    def __init__(self, **values: Any) -> None:
        super().__init__(**dict.fromkeys(FIELDS))
        for name, value in values.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in FIELDS
        super().__setattr__(name, value)


def door(name: str = "kitchen", state: str = "OPEN", **values: Any) -> DoorMessage:
    """A door that is seen."""
    number = CONSTANTS[state]
    known = {
        "seen": True,
        "state": number,
        "filtered_state": number,
        "probability": 0.95,
        "passable_width_m": 0.8,
        "leaf_seen": True,
        "reason": "",
    }
    return DoorMessage(id=name, **known | values)


def doors(*listed: DoorMessage, stamp_s: float = 100.0, reason: str = "") -> Any:
    """A message of doors."""
    stamp = SimpleNamespace(sec=int(stamp_s), nanosec=round(stamp_s % 1 * 1e9))
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), doors=list(listed), reason=reason)
