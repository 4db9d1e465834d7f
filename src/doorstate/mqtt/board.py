# SPDX-License-Identifier: Apache-2.0
"""Doors of one camera as they should stand at a broker, and the messages that bring them there.

Knows no network. All times are those of one steady clock, so that a clock that is set changes nothing. A state stands
for what was seen within `expire_s`: what is not confirmed any more is unknown, and a camera that is silent is offline.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from doorstate.errors import ConfigError
from doorstate.mqtt.discovery import discovery_messages
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.status import DoorStatus
from doorstate.mqtt.topics import (
    OFFLINE,
    ONLINE,
    UNKNOWN,
    Message,
    attributes_topic,
    availability_topic,
    check_level,
    state_topic,
    to_json,
)

MAX_DOORS = 1000  # of one camera; others are refused, so that nothing grows without end


@dataclass
class _Entry:
    """A door on the board."""

    status: DoorStatus
    confirmed_s: float
    seen: datetime | None = None  # when it last had a state
    sent_state: str | None = None  # None: the broker does not know this door
    sent_s: float = -math.inf


class DoorBoard:
    """Newest status of each door of a camera. Not for several threads.

    Args:
        settings: topics and times.
    """

    def __init__(self, settings: MqttSettings) -> None:
        self._settings = settings
        self._entries: dict[str, _Entry] = {}
        self._updated_s = -math.inf
        self._sent_availability: str | None = None

    def update(self, statuses: Iterable[DoorStatus], now_s: float, age_s: float = 0.0) -> None:
        """Enter what the newest cloud says of doors.

        Args:
            statuses: doors; those that are not among them are not confirmed.
            now_s: time on the steady clock.
            age_s: age of the cloud. An older one than `expire_s` is no news of any door, nor of the camera.

        Raises:
            ConfigError: the name of a door cannot be part of a topic, or there are too many doors.
        """
        if not 0 <= age_s < self._settings.expire_s:
            return
        taken_s = now_s - age_s
        self._updated_s = max(self._updated_s, taken_s)
        for status in statuses:
            entry = self._entries.get(status.door)
            if entry is None:
                check_level(status.door)
                _check_count(len(self._entries))
                entry = self._entries[status.door] = _Entry(status, taken_s)
            if taken_s < entry.confirmed_s:  # a newer cloud was faster
                continue
            entry.status, entry.confirmed_s = status, taken_s
            if status.state is not None:
                entry.seen = datetime.now(UTC) - timedelta(seconds=age_s)

    def is_online(self, now_s: float) -> bool:
        """Return True while clouds come."""
        return now_s - self._updated_s < self._settings.silence_s

    def forget_sent(self) -> None:
        """Assume that the broker knows nothing, as after it was started."""
        self._sent_availability = None
        for entry in self._entries.values():
            entry.sent_state = None

    def take_due(self, now_s: float) -> list[Message]:
        """Return the messages that are due, in order, and assume that they are sent."""
        messages: list[Message] = []
        is_online = self.is_online(now_s)
        for door, entry in self._entries.items():
            messages += self._of_door(door, entry, now_s, is_online)
        word = ONLINE if is_online else OFFLINE
        if word != self._sent_availability:
            self._sent_availability = word
            availability = Message(availability_topic(self._settings), word)
            # A camera is never available with states that are older, nor gone with states that look new.
            messages = [*messages, availability] if is_online else [availability, *messages]
        return messages

    def close(self, now_s: float) -> list[Message]:
        """Return the messages that say that nobody watches the doors any more."""
        self._updated_s = -math.inf
        return self.take_due(now_s)

    def _of_door(self, door: str, entry: _Entry, now_s: float, is_online: bool) -> Iterator[Message]:
        word = self._word(entry, now_s)
        is_new = entry.sent_state is None
        # What is not confirmed is not sent again, so that the broker forgets it in time.
        is_news = entry.confirmed_s > entry.sent_s or word == UNKNOWN
        is_due = is_online and is_news and now_s - entry.sent_s >= self._settings.refresh_s
        if not is_due and word == entry.sent_state:
            return
        entry.sent_state, entry.sent_s = word, now_s
        if is_new:
            yield from discovery_messages(self._settings, door)
        expiry_s = self._settings.expire_s - (0.0 if word == UNKNOWN else now_s - entry.confirmed_s)
        yield Message(
            attributes_topic(self._settings, door), to_json(self._attributes(entry, word, now_s)), expiry_s
        )
        yield Message(state_topic(self._settings, door), word, expiry_s)

    def _is_confirmed(self, entry: _Entry, now_s: float) -> bool:
        return self.is_online(now_s) and now_s - entry.confirmed_s < self._settings.expire_s

    def _word(self, entry: _Entry, now_s: float) -> str:
        state = entry.status.state if self._is_confirmed(entry, now_s) else None
        return UNKNOWN if state is None else str(state)

    def _attributes(self, entry: _Entry, word: str, now_s: float) -> dict[str, Any]:
        values: dict[str, Any] = {"state": word, "time": _iso(datetime.now(UTC))}
        if entry.seen is not None:
            values["last_seen"] = _iso(entry.seen)
        if self._is_confirmed(entry, now_s):
            return values | {key: value for key, value in entry.status.details.items() if key not in values}
        silent_s = now_s - (entry.confirmed_s if self.is_online(now_s) else self._updated_s)
        kind = "not seen" if self.is_online(now_s) else "no cloud"
        return values | {"reason": f"{kind} for {silent_s:.0f} s" if math.isfinite(silent_s) else "stopped"}


def _check_count(count: int) -> None:
    """Check that one more door may follow.

    Raises:
        ConfigError: there are too many.
    """
    if count >= MAX_DOORS:
        raise ConfigError("one camera has too many doors", expected=f"at most {MAX_DOORS}")


def _iso(moment: datetime) -> str:
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
