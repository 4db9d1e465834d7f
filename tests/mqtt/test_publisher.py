# SPDX-License-Identifier: Apache-2.0
"""States at a real broker: killed and started again, silent cameras, wrong passwords, TLS, killed programs."""

from __future__ import annotations

import json
import socket
import subprocess
import threading
import time
from pathlib import Path

import pytest

from doorstate.errors import BrokerError
from doorstate.mqtt.publisher import MqttPublisher
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.status import DoorStatus
from doorstate.types import DoorState
from tests.mqtt.broker import PASSWORD, USER, Broker, listening
from tests.waiting import wait_until

OPEN = DoorStatus("front", DoorState.OPEN, {"opening_angle_deg": 88.0})
CLOSED = DoorStatus("front", DoorState.CLOSED)
STATE, AVAILABILITY = "doorstate/hall/front/state", "doorstate/hall/availability"


def settings(port: int, **changes: object) -> MqttSettings:
    quick = {"host": "127.0.0.1", "port": port, "camera": "hall", "silence_s": 0.6, "expire_s": 2.0}
    return MqttSettings.model_validate(quick | changes)


def test_states_are_kept_by_the_broker_with_all_that_is_known(broker: Broker) -> None:
    with listening(broker.port) as listener, MqttPublisher(settings(broker.port)) as publisher:
        publisher.update([OPEN])
        wait_until(lambda: listener.last(AVAILABILITY) == "online")
        assert listener.last(STATE) == "open"
        attributes = json.loads(listener.last("doorstate/hall/front/attributes") or "")
        assert (attributes["state"], attributes["opening_angle_deg"]) == ("open", 88.0)
        assert attributes["time"].endswith("Z")
        publisher.update([CLOSED])
        wait_until(lambda: listener.last(STATE) == "closed")
        with listening(broker.port) as late:
            wait_until(lambda: (STATE, "closed", True) in late.heard)
            wait_until(
                lambda: any(
                    topic.startswith("homeassistant/binary_sensor/") and kept
                    for topic, _, kept in list(late.heard)
                )
            )
        wait_until(lambda: publisher.is_connected)
    with listening(broker.port) as after:
        wait_until(lambda: after.last(AVAILABILITY))
        assert (after.last(AVAILABILITY), after.last(STATE)) == ("offline", "unknown")


def test_a_silent_camera_is_offline_and_the_broker_forgets_its_states(broker: Broker) -> None:
    lines: list[str] = []
    with (
        listening(broker.port) as listener,
        MqttPublisher(settings(broker.port, expire_s=1.0), lines.append) as publisher,
    ):
        publisher.update([OPEN])
        wait_until(lambda: listener.last(STATE) == "open")
        wait_until(lambda: listener.last(AVAILABILITY) == "offline")
        wait_until(lambda: listener.last(STATE) == "unknown")
        assert "no cloud" in json.loads(listener.last("doorstate/hall/front/attributes") or "")["reason"]
        assert any("no cloud for 0.6 s" in line for line in lines)
        time.sleep(1.5)
        with listening(broker.port) as late:
            wait_until(lambda: late.last(AVAILABILITY) == "offline")
            time.sleep(0.2)
            assert late.of(STATE) == []
        publisher.update([CLOSED])
        wait_until(lambda: listener.last(AVAILABILITY) == "online")
        assert listener.last(STATE) == "closed"
        assert listener.of(STATE)[-3:] == ["open", "unknown", "closed"]


def test_a_broker_that_was_killed_gets_the_newest_states_and_no_older_one(broker: Broker) -> None:
    lines: list[str] = []
    with MqttPublisher(settings(broker.port, silence_s=30, expire_s=60), lines.append) as publisher:
        with listening(broker.port) as listener:
            publisher.update([OPEN])
            wait_until(lambda: listener.last(STATE) == "open")
        broker.kill()
        wait_until(lambda: not publisher.is_connected)
        for status in (CLOSED, OPEN, OPEN, CLOSED):
            publisher.update([status])
        broker.start()
        with listening(broker.port) as listener:
            wait_until(lambda: listener.last(STATE))
            wait_until(lambda: listener.last(AVAILABILITY) == "online")
            assert listener.of(STATE) == ["closed"]
            assert any("homeassistant/binary_sensor/" in topic for topic, *_ in listener.heard)
    assert any(line.startswith("lost the broker") for line in lines)
    assert sum(line.startswith("connected") for line in lines) == 2


def test_the_state_of_a_camera_that_is_gone_is_not_sent_when_the_broker_comes(broker: Broker) -> None:
    with MqttPublisher(settings(broker.port)) as publisher:
        publisher.update([OPEN])
        broker.kill()
        time.sleep(0.8)  # longer than silence_s
        broker.start()
        with listening(broker.port) as listener:
            wait_until(lambda: listener.last(AVAILABILITY))
            wait_until(lambda: listener.last(STATE))
            assert (listener.of(AVAILABILITY), listener.of(STATE)) == (["offline"], ["unknown"])


def test_a_broker_that_comes_later_is_found(broker: Broker) -> None:
    broker.kill()
    lines: list[str] = []
    with MqttPublisher(settings(broker.port), lines.append) as publisher:
        assert len(lines) == 1
        assert "has no connection" in lines[0]
        broker.start()
        wait_until(lambda: publisher.is_connected)


def test_what_is_no_broker_ends_nothing() -> None:
    lines: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        publisher = MqttPublisher(settings(server.getsockname()[1]), lines.append)
        with pytest.raises(BrokerError):
            publisher.update([OPEN])
        answer = threading.Thread(target=answer_garbage, args=(server,))
        answer.start()
        with publisher:
            wait_until(lambda: sum("has no connection" in line for line in lines) >= 1)
            publisher.update([OPEN])
            assert not publisher.is_connected
        answer.join()


def answer_garbage(server: socket.socket) -> None:
    connection, _ = server.accept()
    with connection:
        connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" + bytes(range(256)) * 4)
        time.sleep(0.3)


def test_users_and_passwords(tmp_path: Path) -> None:
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-c", "-b", passwords, USER, PASSWORD], check=True)
    broker = Broker(tmp_path, f"password_file {passwords}")
    try:
        with MqttPublisher(settings(broker.port, user=USER, password=PASSWORD)) as publisher:
            assert publisher.is_connected
        for wrong in ({"user": USER, "password": "other"}, {"user": "other", "password": PASSWORD}, {}):
            with pytest.raises(BrokerError) as error, MqttPublisher(settings(broker.port, **wrong)):
                pass
            assert str(broker.port) in str(error.value)
            assert PASSWORD not in str(error.value)
    finally:
        broker.kill()
    assert PASSWORD not in repr(settings(1883, user=USER, password=PASSWORD))


def test_two_programs_for_one_camera_say_so(broker: Broker) -> None:
    lines: list[str] = []
    with MqttPublisher(settings(broker.port), lines.append), MqttPublisher(settings(broker.port)):
        wait_until(lambda: any("another program" in line for line in lines))


@pytest.fixture
def certificates(tmp_path: Path) -> Path:
    openssl = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
    names = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    for name in ("right", "other"):
        files = ["-keyout", tmp_path / f"{name}.key", "-out", tmp_path / f"{name}.pem"]
        subprocess.run([*openssl, *names, *files, "-days", "2"], check=True, capture_output=True)
    return tmp_path


# paho leaves sockets whose handshake failed to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_tls_checks_certificate_and_name(certificates: Path) -> None:
    pem, key = certificates / "right.pem", certificates / "right.key"
    broker = Broker(certificates, f"cafile {pem}", f"certfile {pem}", f"keyfile {key}")
    try:
        secure = settings(broker.port, host="localhost", tls=True, ca_file=pem)
        with MqttPublisher(secure) as publisher:
            assert publisher.is_connected
        other_authority = secure.model_copy(update={"ca_file": certificates / "other.pem"})
        other_name = secure.model_copy(update={"host": "127.0.0.1"})
        for wrong in (other_authority, other_name, secure.model_copy(update={"ca_file": None})):
            with pytest.raises(BrokerError), MqttPublisher(wrong):
                pass
        with pytest.raises(BrokerError) as error:
            MqttPublisher(secure.model_copy(update={"ca_file": key}))
        assert error.value.path == key
    finally:
        broker.kill()
