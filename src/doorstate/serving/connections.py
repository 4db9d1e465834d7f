# SPDX-License-Identifier: Apache-2.0
"""Connections of the service: a deadline for the head of each request, and limits on their number."""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from doorstate.serving.clients import client_of_address
from doorstate.serving.limits import Limits


class Connections:
    """Open connections by address, and those that have not sent the head of a request, oldest first."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.by_client: Counter[str] = Counter()
        self.headless: OrderedDict[GuardedProtocol, None] = OrderedDict()

    def admit(self, client: str) -> bool:
        """Return True if one more connection of this address is served; an older one without a head may end for it."""
        if self.by_client[client] >= self.limits.client_connections:
            return False
        if self.by_client.total() >= self.limits.connections:
            if not self.headless:
                return False
            next(iter(self.headless)).end()
        return True


class GuardedProtocol(H11Protocol):
    """HTTP/1.1 connection that must send the head of a request within a time, and then wait for its next one."""

    guard: Connections

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._head_timer: asyncio.TimerHandle | None = None
        self._address = client_of_address(self.client[0] if self.client else "")
        self._counted = self.guard.admit(self._address)
        if not self._counted:
            self.end()
            return
        self.guard.by_client[self._address] += 1
        self._expect_head()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        # h11 is idle between the end of a request and the head of the next one, of which a part may be here.
        if self.transport.is_closing():
            return
        if self.conn.their_state is h11.IDLE:
            self._expect_head()
        else:
            self._got_head()

    def connection_lost(self, exc: Exception | None) -> None:
        self._got_head()
        if self._counted:
            self.guard.by_client[self._address] -= 1
            if not self.guard.by_client[self._address]:
                del self.guard.by_client[self._address]
        super().connection_lost(exc)

    def end(self) -> None:
        """Close the connection at once."""
        self._got_head()
        self.transport.abort()

    def _expect_head(self) -> None:
        if self._head_timer is None:
            self._head_timer = self.loop.call_later(self.guard.limits.head_timeout_s, self.end)
            self.guard.headless[self] = None

    def _got_head(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None
        self.guard.headless.pop(self, None)


def guarded_protocol(limits: Limits) -> type[GuardedProtocol]:
    """Return the protocol class of one server."""
    members: dict[str, Any] = {"guard": Connections(limits)}
    return type("GuardedProtocol", (GuardedProtocol,), members)
