# SPDX-License-Identifier: Apache-2.0
"""Watch and publisher together: clocks that jump, and memory that stays."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("paho.mqtt.client")

from benchmarks.stream import measure_stream

from doorstate._jobs import no_progress
from doorstate.inference.state_filter import StateFilter
from doorstate.mqtt.board import DoorBoard
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.status import status_of_front_door
from doorstate.types import DoorState
from tests.inference.streams import CLOSED, OPEN, UNKNOWN, predict
from tests.mqtt.broker import Broker, needs_broker

SETTINGS = MqttSettings(camera="hall", discovery_prefix=None)


def sent_states(stream: Iterator[tuple[float, float, DoorState | None]]) -> list[tuple[int, str]]:
    """Return the changes of the state at the broker with the number of their frame.

    Args:
        stream: steady time, stamp and state of each frame; None is a frame without a state.
    """
    board, state_filter, changes = DoorBoard(SETTINGS), StateFilter(), []
    for number, (now_s, stamp_s, state) in enumerate(stream):
        prediction = UNKNOWN if state is None else predict(state)
        status = status_of_front_door(prediction, state_filter.update(prediction, stamp_s))
        board.update([status], now_s)
        words = [message.payload for message in board.take_due(now_s) if message.topic.endswith("/state")]
        changes += [(number, word) for word in words if not changes or word != changes[-1][1]]
    return changes


@pytest.mark.parametrize("jump_s", [-3600.0, 3600.0])
def test_after_a_jump_of_the_clock_the_state_is_unknown_until_it_is_seen_again(jump_s: float) -> None:
    def frames(after: DoorState | None) -> Iterator[tuple[float, float, DoorState | None]]:
        for number in range(60):
            has_jumped = number >= 30
            stamp_s = 1e6 + number / 10 + (jump_s if has_jumped else 0.0)
            yield number / 10, stamp_s, after if has_jumped else OPEN

    assert [word for _, word in sent_states(frames(None))] == ["unknown", "open", "unknown"]
    assert sent_states(frames(None))[-1][0] == 30
    changes = sent_states(frames(CLOSED))
    assert [word for _, word in changes] == ["unknown", "open", "unknown", "closed"]
    assert changes[2][0] == 30
    assert 30 < changes[3][0] < 50


@needs_broker
def test_memory_does_not_grow_with_the_stream(broker: Broker) -> None:
    settings = MqttSettings(host="127.0.0.1", port=broker.port)
    _, first, *_, last = measure_stream(0.03, 3, settings, no_progress)
    assert last["frames"] - first["frames"] > 2000
    assert abs(last["objects"] - first["objects"]) < 300
    assert last["resident_mib"] - first["resident_mib"] < 3
