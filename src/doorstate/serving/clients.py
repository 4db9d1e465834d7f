# SPDX-License-Identifier: Apache-2.0
"""Clients of the service by address, and the time that the service loses on the failures of each."""

from __future__ import annotations

import ipaddress
import math
import time
from collections.abc import Callable

_IPV6_PREFIX = 64  # of the addresses of one household or machine (RFC 6177)
_MAX_CLIENTS = 4096
_MAX_DEBT = 3.0  # times the highest credit


def client_of_address(address: str) -> str:
    """Return the name of a client: its IPv4 address, or the /64 network of its IPv6 address."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return address
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((parsed, _IPV6_PREFIX), strict=False))


class Credit:
    """Seconds of work that a client may lose for the service: a token bucket for each client.

    A failure takes the time that it cost. Files that are predicted and time give credit back, so that a client with
    some damaged files among many keeps its credit.

    Args:
        most_s: credit of a new client, and the highest.
        refill: seconds of credit for each second of time.
        clock: current time in seconds.
    """

    def __init__(self, most_s: float, refill: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._most_s, self._refill, self._clock = most_s, refill, clock
        self._credits: dict[str, tuple[float, float]] = {}  # seconds of credit, and when

    def change(self, client: str, seconds: float) -> None:
        """Give credit to a client, or take it; a debt is at most three times the highest credit."""
        value = max(-_MAX_DEBT * self._most_s, min(self._most_s, self._value(client) + seconds))
        self._credits[client] = (value, self._clock())
        if len(self._credits) > _MAX_CLIENTS:
            self._forget()

    def seconds_in_debt(self, client: str) -> int:
        """Return the time until a client has credit again; 0 if it has."""
        value = self._value(client)
        return 0 if value > 0 else max(1, math.ceil(-value / self._refill))

    def _value(self, client: str) -> float:
        value, since = self._credits.get(client, (self._most_s, 0.0))
        return min(self._most_s, value + (self._clock() - since) * self._refill)

    def _forget(self) -> None:
        """Keep only clients with less than full credit, and of them the later half if they are too many."""
        kept = {
            client: entry for client, entry in self._credits.items() if self._value(client) < self._most_s
        }
        if len(kept) > _MAX_CLIENTS:
            kept = dict(sorted(kept.items(), key=lambda item: item[1][1])[len(kept) // 2 :])
        self._credits = kept
