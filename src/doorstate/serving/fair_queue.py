# SPDX-License-Identifier: Apache-2.0
"""Queue that divides a service evenly between clients, however many items each of them has."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

_Item = TypeVar("_Item")
_MAX_TAGS = 1024


class FairQueue(Generic[_Item]):
    """Items by client; the client that was served least comes first (start-time fair queueing, Goyal et al. 1996).

    A client that was away for some time gets no advantage from it: its service counts from that of the others.
    """

    def __init__(self) -> None:
        self._items: dict[str, deque[_Item]] = {}  # clients in the order of arrival, which decides ties
        self._served: dict[str, float] = {}
        self._now = 0.0  # service of the client that was served last, before that

    def __len__(self) -> int:
        return sum(map(len, self._items.values()))

    def push(self, client: str, item: _Item) -> None:
        """Add an item."""
        self._items.setdefault(client, deque()).append(item)

    def pop(self) -> tuple[str, _Item]:
        """Remove and return the next item with its client.

        Raises:
            IndexError: the queue is empty.
        """
        if not self._items:
            raise IndexError("the queue is empty")
        client = min(self._items, key=self._start)
        self._now = self._start(client)
        item = self._items[client].popleft()
        # To the end, so that clients of equal service alternate.
        rest = self._items.pop(client)
        if rest:
            self._items[client] = rest
        return client, item

    def remove(self, client: str, item: _Item) -> bool:
        """Remove an item; return False if it is not in the queue."""
        items = self._items.get(client)
        if items is None or item not in items:
            return False
        items.remove(item)
        if not items:
            del self._items[client]
        return True

    def charge(self, client: str, cost: float) -> None:
        """Count service of a client, in units of the caller's choice."""
        self._served[client] = self._start(client) + cost
        if len(self._served) > _MAX_TAGS:
            self._served = {name: served for name, served in self._served.items() if served > self._now}

    def _start(self, client: str) -> float:
        return max(self._now, self._served.get(client, 0.0))
