# SPDX-License-Identifier: Apache-2.0
"""The action server beside rclpy; messages that are built nowhere here are stand-ins."""

from __future__ import annotations

import sys
import time
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from doorstate_nav.memory import DoorMemory

from tests.ros2.doors import door, doors
from tests.ros2.test_nav_doors import goal

WARNING = "module 'sre_"  # of the parser of lark-parser, which message types import
pytestmark = pytest.mark.filterwarnings(f"ignore:{WARNING}:DeprecationWarning")


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A server without a node."""
    action = SimpleNamespace(Feedback=SimpleNamespace, Result=SimpleNamespace)
    for name, content in (("msg", {"Doors": object}), ("action", {"WaitForDoor": action})):
        module = ModuleType(f"doorstate_msgs.{name}")
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, f"doorstate_msgs.{name}", module)
    monkeypatch.setitem(sys.modules, "doorstate_msgs", ModuleType("doorstate_msgs"))
    for name in ("door_messages", "wait_server"):
        monkeypatch.delitem(sys.modules, f"doorstate_nav.{name}", raising=False)
    from doorstate_nav.wait_server import WaitServer

    made = WaitServer.__new__(WaitServer)
    made._memory, made._waiting = DoorMemory(), 0
    return made


class Handle:
    """Goal handle of rclpy."""

    def __init__(self, request: Any, cancel_after: int = 1000) -> None:
        self.request, self._cancel_after = request, cancel_after
        self.feedback: list[Any] = []
        self.ended: list[str] = []

    @property
    def is_cancel_requested(self) -> bool:
        return len(self.feedback) >= self._cancel_after

    def publish_feedback(self, feedback: Any) -> None:
        self.feedback.append(feedback)

    def succeed(self) -> None:
        self.ended.append("succeeded")

    def abort(self) -> None:
        self.ended.append("aborted")

    def canceled(self) -> None:
        self.ended.append("cancelled")


def test_a_goal_succeeds_aborts_or_is_cancelled(server: Any) -> None:
    server._memory.update(doors(door()), time.monotonic())
    reached = Handle(goal(hold_s=0.0))
    assert server._execute(reached).reached is True
    assert reached.ended == ["succeeded"]
    late = Handle(goal(door="lab", timeout_s=0.25))
    result = server._execute(late)
    assert (result.reached, late.ended) == (False, ["aborted"])
    assert result.reason.startswith("timed out")
    assert 1 <= len(late.feedback) <= 4
    assert late.feedback[0].reason
    cancelled = Handle(goal(door="lab"), cancel_after=2)
    assert server._execute(cancelled).reached is False
    assert cancelled.ended == ["cancelled"]
    assert server._waiting == 0
