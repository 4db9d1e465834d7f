# SPDX-License-Identifier: Apache-2.0
"""Action server `wait_for_door` (doorstate_msgs/WaitForDoor)."""

from __future__ import annotations

import sys
import time
from typing import Any

from doorstate_msgs.action import WaitForDoor
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from doorstate_nav.door_messages import parameter, remember_doors, spin
from doorstate_nav.memory import EXPIRE_S, DoorMemory
from doorstate_nav.waiting import DoorWait, Progress

_STEP_S = 0.1
MAX_GOALS = 16  # that wait at the same time, each in a thread


class WaitServer(Node):  # type: ignore[misc]  # rclpy has no types where it is not installed
    """At most `MAX_GOALS` goals wait at the same time."""

    def __init__(self) -> None:
        super().__init__("doorstate_wait")
        expire_s = parameter(self, "expire_s", EXPIRE_S, "Time after which a state counts no more.")
        self._memory = DoorMemory(expire_s)
        self._waiting = 0
        group = ReentrantCallbackGroup()
        remember_doors(self, self._memory, callback_group=group)
        self._server = ActionServer(
            self,
            WaitForDoor,
            "wait_for_door",
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def _accept(self, goal: Any) -> Any:
        try:
            DoorWait(goal, 0.0)
        except ValueError as error:
            self.get_logger().warning(f"goal refused: {error}")
            return GoalResponse.REJECT
        if self._waiting >= MAX_GOALS:
            self.get_logger().warning(f"goal refused: {MAX_GOALS} others are waiting")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _execute(self, handle: Any) -> Any:
        self._waiting += 1
        try:
            return self._wait(handle)
        finally:
            self._waiting -= 1

    def _wait(self, handle: Any) -> Any:
        wait = DoorWait(handle.request, time.monotonic())
        while True:
            progress = wait.step(self._memory, time.monotonic())
            if handle.is_cancel_requested:
                handle.canceled()
                return _result(progress._replace(reached=False, reason="cancelled"))
            if progress.reached is not None:
                (handle.succeed if progress.reached else handle.abort)()
                return _result(progress)
            handle.publish_feedback(
                WaitForDoor.Feedback(
                    state=progress.state,
                    held_s=progress.held_s,
                    silent_s=progress.silent_s,
                    reason=progress.reason,
                )
            )
            time.sleep(_STEP_S)


def _result(progress: Progress) -> Any:
    return WaitForDoor.Result(reached=bool(progress.reached), state=progress.state, reason=progress.reason)


def main() -> int:
    """Run the server."""
    # Two more, so that messages and cancellations come in while all goals wait.
    return spin(WaitServer, MAX_GOALS + 2)


if __name__ == "__main__":
    sys.exit(main())
