# SPDX-License-Identifier: Apache-2.0
"""Order of items of several clients."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.serving.fair_queue import _MAX_TAGS, FairQueue


def test_clients_take_turns_however_many_items_they_have() -> None:
    queue: FairQueue[int] = FairQueue()
    for number in range(100):
        queue.push("many", number)
    for number in range(3):
        queue.push("few", number)
    order = []
    for _ in range(8):
        client, _ = queue.pop()
        queue.charge(client, 1.0)
        order.append(client)
    assert order == ["many", "few"] * 3 + ["many"] * 2
    assert len(queue) == 95


def test_who_costs_more_waits_longer() -> None:
    queue: FairQueue[int] = FairQueue()
    costs = {"light": 1.0, "heavy": 10.0}
    for number in range(200):
        for client in costs:
            queue.push(client, number)
    served: Counter[str] = Counter()
    for _ in range(110):
        client, _ = queue.pop()
        queue.charge(client, costs[client])
        served[client] += 1
    assert served["heavy"] == pytest.approx(10, abs=1)


def test_absence_gives_no_advantage() -> None:
    queue: FairQueue[int] = FairQueue()
    for number in range(50):
        queue.push("busy", number)
    for _ in range(20):
        queue.charge(queue.pop()[0], 1.0)
    for number in range(20):
        queue.push("back", number)
    served = Counter()
    for _ in range(20):
        client, _ = queue.pop()
        queue.charge(client, 1.0)
        served[client] += 1
    assert abs(served["back"] - served["busy"]) <= 1


def test_items_are_removed_and_an_empty_queue_has_none() -> None:
    queue: FairQueue[str] = FairQueue()
    queue.push("a", "x")
    assert queue.remove("a", "x")
    assert not queue.remove("a", "x")
    assert not queue.remove("b", "x")
    assert not queue
    with pytest.raises(IndexError):
        queue.pop()


def test_clients_are_forgotten() -> None:
    queue: FairQueue[int] = FairQueue()
    for number in range(3 * _MAX_TAGS):
        queue.push(str(number), 0)
        client, _ = queue.pop()
        queue.charge(client, 1.0)
        queue.push(client, 0)
        queue.pop()
    assert len(queue._served) <= 2 * _MAX_TAGS


@given(st.lists(st.tuples(st.sampled_from("abc"), st.floats(0, 5)), max_size=60))
def test_every_item_comes_once_and_in_the_order_of_its_client(items: list[tuple[str, float]]) -> None:
    queue: FairQueue[tuple[int, float]] = FairQueue()
    for number, (client, cost) in enumerate(items):
        queue.push(client, (number, cost))
    popped: dict[str, list[int]] = {}
    while queue:
        client, (number, cost) = queue.pop()
        queue.charge(client, cost)
        popped.setdefault(client, []).append(number)
    expected = {
        name: [number for number, (client, _) in enumerate(items) if client == name]
        for name in {client for client, _ in items}
    }
    assert popped == expected
