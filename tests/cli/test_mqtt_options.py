# SPDX-License-Identifier: Apache-2.0
"""States on MQTT by the command line: at a real broker, with its last will, and refused in one line."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from doorstate.cli.mqtt_options import MqttOptions, read_mqtt_options
from doorstate.errors import ConfigError
from doorstate.io.pcd import write_pcd
from doorstate.simulation.frames import Frame
from tests.mqtt.broker import MOSQUITTO, PASSWORD, USER, Broker, listening
from tests.waiting import wait_until

Run = Callable[..., tuple[int, str, str]]
STATE, AVAILABILITY = "doorstate/hall/door/state", "doorstate/hall/availability"
pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed")


def options(address: str | None, **changes: object) -> MqttOptions:
    plain = {
        "mqtt_camera": "hall",
        "mqtt_prefix": "doorstate",
        "mqtt_discovery": "homeassistant",
        "mqtt_semi_open": "open",
        "mqtt_expire_s": 15.0,
        "mqtt_password_file": None,
        "mqtt_ca": None,
    }
    return read_mqtt_options(address, **(plain | changes))  # type: ignore[arg-type]


def test_options_become_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert options(None).settings is None
    monkeypatch.setenv("DOORSTATE_MQTT_PASSWORD", "of the environment")
    (tmp_path / "password").write_text("of the file\n")
    for file, password in ((None, "of the environment"), (tmp_path / "password", "of the file")):
        settings = options("mqtt://robot@broker", mqtt_password_file=file, mqtt_discovery="off").settings
        assert settings is not None
        assert settings.password is not None
        assert settings.password.get_secret_value() == password
        assert (settings.user, settings.discovery_prefix, settings.silence_s) == ("robot", None, 5.0)


@pytest.mark.parametrize(
    ("address", "changes", "field"),
    [
        ("mqtt://broker", {"mqtt_camera": "a/b"}, "mqtt_camera"),
        ("mqtt://broker", {"mqtt_prefix": "#"}, "mqtt_prefix"),
        ("mqtt://broker", {"mqtt_discovery": "+"}, "mqtt_discovery"),
        ("mqtt://broker", {"mqtt_semi_open": "ajar"}, "mqtt_semi_open"),
        ("mqtt://broker", {"mqtt_expire_s": float("nan")}, "mqtt_expire_s"),
        ("mqtt://broker", {"mqtt_ca": Path("ca.pem")}, None),
        (None, {"mqtt_ca": Path("ca.pem")}, None),
    ],
)
def test_wrong_options(address: str | None, changes: dict[str, object], field: str | None) -> None:
    with pytest.raises(ConfigError) as error:
        options(address, **changes)
    assert error.value.field == field


@pytest.fixture
def recording(frames: list[Frame], tmp_path: Path) -> Path:
    """Open door, seen for five seconds ten times a second."""
    folder = tmp_path / "recording"
    folder.mkdir()
    for number in range(50):
        write_pcd(folder / f"{number:02d}.pcd", frames[2].points[::4, ::4])
    return folder


def test_a_live_stream_is_published_and_its_end_too(recording: Path, broker: Broker) -> None:
    command = [sys.executable, "-m", "doorstate", "view", "--live", recording, "--rate", "10", "--no-open"]
    mqtt = ["--mqtt", f"mqtt://127.0.0.1:{broker.port}", "--mqtt-camera", "hall", "--mqtt-expire-s", "3"]
    with listening(broker.port) as listener:
        program = subprocess.Popen([*command, "--rule", "plane_state", *mqtt], stdout=subprocess.DEVNULL)
        try:
            wait_until(lambda: listener.last(STATE) == "open" and listener.last(AVAILABILITY) == "online", 20)
            attributes = json.loads(listener.last("doorstate/hall/door/attributes") or "")
            assert attributes["probability"] >= 0.8
            assert listener.of(STATE)[0] == "unknown"
        finally:
            program.kill()
            program.wait()
        wait_until(lambda: listener.last(AVAILABILITY) == "offline")  # the last will
    wait_until(lambda: time.sleep(0.5) or is_forgotten(broker))  # type: ignore[func-returns-value]


def is_forgotten(broker: Broker) -> bool:
    """Return True if a new subscriber hears that the camera is offline, and no state."""
    with listening(broker.port) as late:
        wait_until(lambda: late.last(AVAILABILITY) == "offline")
        time.sleep(0.1)
        return late.of(STATE) == []


def test_watch_publishes_and_its_end_is_said(broker: Broker, run: Run, weights: Path) -> None:
    camera = ("--camera", "simulated", "--size", "64x48", "--fps", 20, "--seconds", 1.5, "--weights", weights)
    with listening(broker.port) as listener:
        code, _, errors = run(
            "watch", *camera, "--mqtt", f"mqtt://127.0.0.1:{broker.port}", "--mqtt-camera", "hall"
        )
        assert code == 0
        wait_until(lambda: listener.of(AVAILABILITY) == ["offline", "online", "offline"])
        wait_until(lambda: listener.last(STATE) == "unknown")
    assert "mqtt: connected" in errors


def test_a_wrong_password_is_one_line(
    recording: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    passwords = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-c", "-b", passwords, USER, PASSWORD], check=True)
    broker = Broker(tmp_path, f"password_file {passwords}")
    monkeypatch.setenv("DOORSTATE_MQTT_PASSWORD", "wrong")
    live = ("view", "--live", recording, "--no-open", "--rule", "plane_state", "--mqtt")
    try:
        code, _, errors = run(*live, f"mqtt://{USER}@127.0.0.1:{broker.port}")
    finally:
        broker.kill()
    assert code == 1
    assert [line for line in errors.splitlines() if line.startswith("doorstate: ")] == errors.splitlines()[
        -1:
    ]
    assert "password" in errors.splitlines()[-1]
    assert run(*live, "mqtt://a:b@broker")[0] == 2
    assert run("view", recording, "--mqtt", "mqtt://broker")[0] == 2
