# SPDX-License-Identifier: Apache-2.0
"""Adapter of Open-RMF: rmf_door_msgs/DoorState of doors that doorstate sees, once a second."""

from __future__ import annotations

import sys
import time
from typing import get_args

from rclpy.node import Node
from rmf_door_msgs.msg import DoorMode, DoorState

from doorstate.errors import ConfigError
from doorstate_nav.door_messages import parameter, remember_doors, spin
from doorstate_nav.memory import EXPIRE_S, DoorMemory
from doorstate_nav.rmf import SemiOpen, door_mode


class RmfAdapter(Node):  # type: ignore[misc]  # rclpy has no types where it is not installed
    """Publishes all doors of the parameter `doors` on `door_states`."""

    def __init__(self) -> None:
        super().__init__("doorstate_rmf")
        self._doors = parameter(
            self, "doors", [""], "Names of doors, the same in the list of doors and in RMF."
        )
        self._semi_open = parameter(
            self, "semi_open", "moving", f"What a semi-open door is: {', '.join(get_args(SemiOpen))}."
        )
        self._require_leaf = parameter(
            self, "require_leaf", True, "An open door without a visible leaf, which may be glass, is unknown."
        )
        self._silence_s = parameter(self, "silence_s", 5.0, "Time without a message until a door is offline.")
        expire_s = parameter(self, "expire_s", EXPIRE_S, "Time after which a state counts no more.")
        if not any(self._doors):
            raise ConfigError("names no door", field="doors")
        if self._semi_open not in get_args(SemiOpen):
            raise ConfigError(
                f"cannot be {self._semi_open!r}", field="semi_open", expected=" or ".join(get_args(SemiOpen))
            )
        self._memory = DoorMemory(expire_s)
        remember_doors(self, self._memory)
        self._states = self.create_publisher(DoorState, "door_states", 10)
        self.create_timer(1.0, self._publish)

    def _publish(self) -> None:
        for door in self._doors:
            mode = door_mode(
                self._memory,
                door,
                time.monotonic(),
                semi_open=self._semi_open,
                require_leaf=self._require_leaf,
                silence_s=self._silence_s,
            )
            now = self.get_clock().now().to_msg()
            self._states.publish(DoorState(door_time=now, door_name=door, current_mode=DoorMode(value=mode)))


def main() -> int:
    """Run the adapter."""
    return spin(RmfAdapter)


if __name__ == "__main__":
    sys.exit(main())
