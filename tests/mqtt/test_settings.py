# SPDX-License-Identifier: Apache-2.0
"""Addresses, passwords, topics and the configuration of Home Assistant's entities."""

from __future__ import annotations

import json
from pathlib import Path

import jinja2
import pytest
from pydantic import ValidationError

from doorstate.errors import ConfigError
from doorstate.mqtt.discovery import discovery_messages
from doorstate.mqtt.settings import MqttSettings, parse_address, read_password
from doorstate.mqtt.topics import identifier


@pytest.mark.parametrize(
    ("text", "host", "port", "tls", "user"),
    [
        ("mqtt://broker", "broker", 1883, False, None),
        ("broker:1884", "broker", 1884, False, None),
        ("mqtts://robot@broker.local", "broker.local", 8883, True, "robot"),
        ("mqtt://a%40b@[::1]:1", "::1", 1, False, "a@b"),
    ],
)
def test_addresses(text: str, host: str, port: int, tls: bool, user: str | None) -> None:
    address = parse_address(text)
    assert (address.host, address.port, address.tls, address.user) == (host, port, tls, user)


@pytest.mark.parametrize(
    "text", ["", "http://broker", "mqtt://", "mqtt://broker:x", "mqtt://b:70000", "mqtt://b/topic"]
)
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_address(text)
    assert error.value.field == "mqtt"


def test_passwords_are_not_taken_from_the_address_nor_shown(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        parse_address("mqtt://robot:hidden@broker")
    assert "hidden" not in str(error.value)
    (tmp_path / "password").write_text("hidden \n")
    password = read_password(tmp_path / "password")
    assert password.get_secret_value() == "hidden "
    assert "hidden" not in repr(MqttSettings(user="robot", password=password))
    (tmp_path / "password").write_text("\n")
    with pytest.raises(ConfigError):
        read_password(tmp_path / "password")
    with pytest.raises(ValidationError):
        MqttSettings(password=password)


@pytest.mark.parametrize("camera", ["", "a/b", "+", "#", "$SYS", "x\x00"])
def test_names_of_cameras(camera: str) -> None:
    with pytest.raises(ValidationError):
        MqttSettings(camera=camera)


def test_identifiers_differ_as_names_do() -> None:
    names = ["front", "a b", "a_b", "a  b", "Tür", "T_r", "日本"]
    found = [identifier(name) for name in names]
    assert len(set(found)) == len(names)
    assert all(name.isascii() and name.replace("_", "").replace("-", "").isalnum() for name in found)


@pytest.mark.parametrize(("semi_open", "word"), [("open", "ON"), ("closed", "OFF"), ("unknown", "None")])
def test_home_assistant_gets_a_door_and_three_states(semi_open: str, word: str) -> None:
    settings = MqttSettings.model_validate({"camera": "hall", "semi_open": semi_open, "expire_s": 14.2})
    topics, configurations = zip(
        *((message.topic, json.loads(message.payload)) for message in discovery_messages(settings, "front")),
        strict=True,
    )
    assert topics == (
        "homeassistant/binary_sensor/doorstate_hall/front/config",
        "homeassistant/sensor/doorstate_hall/front/config",
    )
    for configuration in configurations:
        assert configuration["state_topic"] == "doorstate/hall/front/state"
        assert configuration["availability_topic"] == "doorstate/hall/availability"
        assert configuration["expire_after"] == 15
    binary, three = configurations
    assert (binary["device_class"], three["device_class"]) == ("door", "enum")
    assert binary["unique_id"] != three["unique_id"]
    words = {
        state: jinja2.Template(binary["value_template"]).render(value=state)
        for state in ("open", "semi_open", "closed", "unknown")
    }
    assert words == {"open": "ON", "semi_open": word, "closed": "OFF", "unknown": "None"}
    assert jinja2.Template(three["value_template"]).render(value="unknown") == "None"
    assert [
        jinja2.Template(three["value_template"]).render(value=state) for state in three["options"]
    ] == three["options"]


def test_without_discovery() -> None:
    assert discovery_messages(MqttSettings(discovery_prefix=None), "front") == []
