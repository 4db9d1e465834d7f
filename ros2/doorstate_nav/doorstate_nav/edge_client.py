# SPDX-License-Identifier: Apache-2.0
"""Client of Nav2's route server: edges through doors are closed and opened (nav2_msgs/DynamicEdges)."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from nav2_msgs.srv import DynamicEdges
from rclpy.node import Node

from doorstate_nav.door_messages import parameter, remember_doors, spin
from doorstate_nav.edges import EdgeKeeper, read_edge_table
from doorstate_nav.memory import EXPIRE_S, DoorMemory

_ANSWER_S = 5.0
SERVICE = "route_server/DynamicEdgesScorer/adjust_edges"


class EdgeClient(Node):  # type: ignore[misc]  # rclpy has no types where it is not installed
    """Compares doors and edges once a `period_s`, and asks for changes alone."""

    def __init__(self) -> None:
        super().__init__("doorstate_edges")
        path = parameter(self, "edges", "", "Table of doors and edges (YAML).")
        service = parameter(self, "service", SERVICE, "Service of the route server.")
        period_s = parameter(self, "period_s", 0.5, "Time between two comparisons.")
        expire_s = parameter(self, "expire_s", EXPIRE_S, "Time after which a state counts no more.")
        self._table = read_edge_table(Path(path))
        self._memory, self._keeper = DoorMemory(expire_s), EdgeKeeper(self._table)
        self._client = self.create_client(DynamicEdges, service)
        self._asked_s: float | None = None  # when a request was sent that has no answer yet
        remember_doors(self, self._memory)
        self.create_timer(period_s, self._compare)

    def _compare(self) -> None:
        now_s = time.monotonic()
        is_late = self._asked_s is not None and now_s - self._asked_s >= _ANSWER_S
        if is_late or not self._client.service_is_ready():  # it was ended, or started again
            self._asked_s = None
            self._keeper.forget()
            return
        if self._asked_s is not None:
            return
        doors = {entry.door: self._memory.at(entry.door, now_s) for entry in self._table.doors}
        changes = self._keeper.changes(doors)
        if changes.closed or changes.opened:
            self._asked_s = now_s
            request = DynamicEdges.Request(closed_edges=changes.closed, opened_edges=changes.opened)
            self._client.call_async(request).add_done_callback(self._on_answer)

    def _on_answer(self, future: Any) -> None:
        self._asked_s = None
        if future.exception() is not None or not future.result().success:
            self.get_logger().warning("the route server did not change its edges: they are sent again")
            self._keeper.forget()


def main() -> int:
    """Run the client."""
    return spin(EdgeClient)


if __name__ == "__main__":
    sys.exit(main())
