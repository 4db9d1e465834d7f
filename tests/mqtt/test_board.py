# SPDX-License-Identifier: Apache-2.0
"""What stands at a broker, and when, on a clock that the test sets."""

from __future__ import annotations

import json
import math

import pytest

from doorstate.errors import ConfigError
from doorstate.mqtt.board import MAX_DOORS, DoorBoard
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.status import DoorStatus
from doorstate.mqtt.topics import Message
from doorstate.types import DoorState

SETTINGS = MqttSettings(camera="hall", silence_s=5.0, expire_s=15.0, discovery_prefix=None)
OPEN, CLOSED = DoorStatus("front", DoorState.OPEN), DoorStatus("front", DoorState.CLOSED)
STATE, AVAILABILITY = "doorstate/hall/front/state", "doorstate/hall/availability"


def texts(messages: list[Message]) -> dict[str, str]:
    return {message.topic: message.payload for message in messages}


def test_a_state_is_sent_when_it_changes_and_again_while_it_stays() -> None:
    board = DoorBoard(SETTINGS)
    sent = []
    for frame in range(301):  # ten seconds
        board.update([OPEN if frame < 150 else CLOSED], frame / 30)
        sent += [(frame, message.payload) for message in board.take_due(frame / 30) if message.topic == STATE]
    assert sent == [(0, "open"), (150, "closed"), (300, "closed")]  # refreshed after five seconds


def test_states_come_before_online_and_offline_before_unknown() -> None:
    board = DoorBoard(SETTINGS)
    assert board.take_due(0.0) == [Message(AVAILABILITY, "offline")]
    board.update([OPEN], 1.0)
    *states, last = board.take_due(1.0)
    assert (last, states[-1]) == (Message(AVAILABILITY, "online"), Message(STATE, "open", 15.0))
    first, *states = board.take_due(6.0)
    assert (first, states[-1]) == (Message(AVAILABILITY, "offline"), Message(STATE, "unknown", 15.0))
    assert board.take_due(100.0) == []  # silence needs no more words
    board.update([CLOSED], 101.0)
    assert texts(board.take_due(101.0))[STATE] == "closed"


def test_a_door_that_is_not_confirmed_is_unknown_while_another_is_seen() -> None:
    board = DoorBoard(SETTINGS)
    board.update([OPEN, DoorStatus("back", DoorState.CLOSED)], 0.0)
    board.take_due(0.0)
    for second in range(1, 15):
        board.update([DoorStatus("back", DoorState.CLOSED)], second)
        assert texts(board.take_due(second)).get(STATE) is None
    board.update([DoorStatus("back", DoorState.CLOSED)], 15)
    sent = texts(board.take_due(15))
    assert sent[STATE] == "unknown"
    attributes = json.loads(sent["doorstate/hall/front/attributes"])
    assert (attributes["state"], attributes["reason"]) == ("unknown", "not seen for 15 s")
    assert attributes["last_seen"] <= attributes["time"]


def test_old_clouds_are_no_news() -> None:
    board = DoorBoard(SETTINGS)
    for age_s in (15.0, 3600.0, -1.0, math.nan):
        board.update([OPEN], 0.0, age_s)
    assert board.take_due(0.0) == [Message(AVAILABILITY, "offline")]
    board.update([OPEN], 1.0, 4.0)
    assert board.take_due(1.0)[-2] == Message(STATE, "open", 11.0)
    board.update([CLOSED], 1.5, 4.6)  # was overtaken
    assert board.take_due(1.5) == []
    assert texts(board.take_due(2.5))[STATE] == "unknown"  # five seconds after it was taken


def test_after_a_new_connection_everything_is_said_as_it_is_now() -> None:
    board = DoorBoard(SETTINGS.model_copy(update={"discovery_prefix": "homeassistant"}))
    board.update([OPEN], 0.0)
    before = board.take_due(0.0)
    board.forget_sent()
    board.update([CLOSED], 1.0)
    after = board.take_due(1.0)
    assert [message.topic for message in after] == [message.topic for message in before]
    assert texts(after)[STATE] == "closed"


def test_the_end_leaves_nothing_that_looks_new() -> None:
    board = DoorBoard(SETTINGS)
    board.update([OPEN], 0.0)
    board.take_due(0.0)
    sent = texts(board.close(0.1))
    assert (sent[AVAILABILITY], sent[STATE]) == ("offline", "unknown")
    assert json.loads(sent["doorstate/hall/front/attributes"])["reason"] == "stopped"


@pytest.mark.parametrize("name", ["", "a/b", "a+", "#", "$SYS", "a\n", "x" * 101, "availability"])
def test_names_that_are_no_level_of_a_topic(name: str) -> None:
    with pytest.raises(ConfigError):
        DoorBoard(SETTINGS).update([DoorStatus(name, DoorState.OPEN)], 0.0)


def test_the_number_of_doors_is_limited() -> None:
    board = DoorBoard(SETTINGS)
    board.update([DoorStatus(str(number), None) for number in range(MAX_DOORS)], 0.0)
    with pytest.raises(ConfigError):
        board.update([DoorStatus("one more", None)], 0.0)
