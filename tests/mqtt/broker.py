# SPDX-License-Identifier: Apache-2.0
"""A real broker on this machine, and a client that writes down all that it hears."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

paho = pytest.importorskip("paho.mqtt.client")
from paho.mqtt.enums import CallbackAPIVersion  # noqa: E402

from tests.waiting import wait_until  # noqa: E402

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
needs_broker = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed")
USER, PASSWORD = "robot", "secret word"


class Broker:
    """Mosquitto; it keeps nothing when it is killed."""

    def __init__(self, folder: Path, *lines: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port: int = free.getsockname()[1]
        self._config = folder / f"{self.port}.conf"
        anonymous = [] if any("password_file" in line for line in lines) else ["allow_anonymous true"]
        # As root, mosquitto becomes another user, who cannot read files of a test.
        own = ["user root", f"listener {self.port} 127.0.0.1", "log_type none"]
        self._config.write_text("\n".join([*own, *anonymous, *lines]) + "\n")
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen([str(MOSQUITTO), "-c", self._config])
        wait_until(self._listens)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def _listens(self) -> bool:
        assert self.process.poll() is None, "mosquitto has ended"
        with socket.socket() as client:
            return client.connect_ex(("127.0.0.1", self.port)) == 0


class Listener:
    """Everything that a subscriber of all topics hears, in order: topic, text, and if the broker had kept it."""

    def __init__(self, port: int) -> None:
        self.heard: list[tuple[str, str, bool]] = []
        self._client: Any = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        self._client.on_connect = lambda client, *_: client.subscribe("#", qos=1)
        self._client.on_message = lambda client, data, message: self.heard.append(
            (message.topic, message.payload.decode(), message.retain)
        )
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def of(self, topic: str) -> list[str]:
        return [text for heard, text, _ in list(self.heard) if heard == topic]

    def last(self, topic: str) -> str | None:
        return next(iter(self.of(topic)[::-1]), None)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


@contextmanager
def listening(port: int) -> Iterator[Listener]:
    listener = Listener(port)
    try:
        yield listener
    finally:
        listener.close()
