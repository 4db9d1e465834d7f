# SPDX-License-Identifier: Apache-2.0
"""Publisher of the doors of one camera, with a thread of its own for the network and for silence."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Self

from doorstate.cameras.clock import steady_s
from doorstate.errors import BrokerError
from doorstate.mqtt.board import DoorBoard
from doorstate.mqtt.connection import CONNECT_TIMEOUT_S, Connection
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.status import DoorStatus

_STEP_S = 0.1
_CLOSE_S = 2.0


def _ignore(line: str) -> None:
    pass


class MqttPublisher:
    """Publish the states of doors, as a context manager; `update` never waits for the network.

    The newest state of each door is published when it changes, three times within `expire_s` while it stays, and after
    each connection. Without clouds for `silence_s` the camera is offline and its doors are unknown. States that could
    not be sent are never sent later.

    Args:
        settings: broker, camera and times.
        notify: gets one line about the connection, or a silent camera; called by the publisher's thread.
        clock: seconds of a clock that is never set, and goes on while the machine sleeps, for silence and expiry.

    Raises:
        MissingExtraError: paho-mqtt is not installed.
        BrokerError: on entering, the broker refuses the user, the password or TLS. One that cannot be reached is tried
            again for as long as the publisher lives.
    """

    def __init__(
        self,
        settings: MqttSettings,
        notify: Callable[[str], None] = _ignore,
        clock: Callable[[], float] = steady_s,
    ) -> None:
        self._settings, self._notify, self._clock = settings, notify, clock
        self._lock = threading.Lock()
        self._board = DoorBoard(settings)
        self._connection = Connection(settings, notify)
        self._was_online: bool | None = None
        self._stopping, self._tried = threading.Event(), threading.Event()
        self._first_refusal: BrokerError | None = None
        self._thread = threading.Thread(target=self._run, name="doorstate-mqtt", daemon=True)

    def __enter__(self) -> Self:
        if self._connection.warns_of_password:
            self._notify(f"the password goes to {self._settings.address} without TLS")
        self._thread.start()
        self._tried.wait(3 * CONNECT_TIMEOUT_S)
        if self._first_refusal is not None:
            self._stop()
            raise self._first_refusal
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop()

    @property
    def is_connected(self) -> bool:
        """True with a connection to the broker."""
        return self._connection.is_up

    def update(self, statuses: Iterable[DoorStatus], age_s: float = 0.0) -> None:
        """Hand over what the newest cloud says of doors.

        Args:
            statuses: doors of the camera.
            age_s: age of the cloud in seconds; an old one is no news.

        Raises:
            BrokerError: the publisher was not entered, or was left.
            ConfigError: the name of a door cannot be part of a topic.
        """
        if not self._thread.is_alive():
            raise BrokerError("the publisher is not running")
        with self._lock:
            self._board.update(statuses, self._clock(), age_s)

    def _stop(self) -> None:
        self._stopping.set()
        # A network that does not answer keeps the thread, which the interpreter does not wait for.
        self._thread.join(_CLOSE_S)

    def _run(self) -> None:
        connection = self._connection
        while not self._stopping.is_set():
            if not connection.step(time.monotonic(), _STEP_S):
                self._stopping.wait(_STEP_S)
            self._note_first_attempt()
            self._say_if_silent()
            self._send_due()
        with self._lock:
            messages = self._board.close(self._clock())
        connection.finish(messages)

    def _note_first_attempt(self) -> None:
        if not self._tried.is_set() and (self._connection.is_up or not self._connection.is_connecting):
            self._first_refusal = self._connection.refusal
            self._tried.set()

    def _say_if_silent(self) -> None:
        with self._lock:
            is_online = self._board.is_online(self._clock())
        if self._was_online is not None and is_online != self._was_online:
            silence_s = self._settings.silence_s
            self._notify(
                "clouds come: the camera is online"
                if is_online
                else f"no cloud for {silence_s:g} s: the camera is offline"
            )
        self._was_online = is_online

    def _send_due(self) -> None:
        # While the network takes nothing, states wait on the board, where newer ones replace them.
        if not self._connection.is_up or self._connection.is_busy:
            return
        with self._lock:
            if self._connection.take_come_up():
                self._board.forget_sent()
            messages = self._board.take_due(self._clock())
        for message in messages:
            self._connection.send(message)
