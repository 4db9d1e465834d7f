# SPDX-License-Identifier: Apache-2.0
"""Configuration of the entities of a door in Home Assistant, which it reads from MQTT.

Each door has a binary sensor of the class `door`, and a sensor with the three states.
Source: https://www.home-assistant.io/integrations/mqtt (discovery), .../binary_sensor.mqtt, .../sensor.mqtt
"""

from __future__ import annotations

import math
from typing import Any

from doorstate import __version__
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.topics import (
    OFFLINE,
    ONLINE,
    UNKNOWN,
    Message,
    attributes_topic,
    availability_topic,
    identifier,
    state_topic,
    to_json,
)
from doorstate.types import STATES, DoorState

_ON, _OFF, _NONE = "ON", "OFF", "None"  # the last is Home Assistant's word for unknown
_BINARY = {"open": _ON, "closed": _OFF, "unknown": _NONE}


def discovery_messages(settings: MqttSettings, door: str) -> list[Message]:
    """Return the configurations of a door's two entities; none where discovery is off."""
    if settings.discovery_prefix is None:
        return []
    node, name = identifier(f"{settings.prefix}_{settings.camera}"), identifier(door)
    common: dict[str, Any] = {
        "state_topic": state_topic(settings, door),
        "json_attributes_topic": attributes_topic(settings, door),
        "availability_topic": availability_topic(settings),
        "payload_available": ONLINE,
        "payload_not_available": OFFLINE,
        "expire_after": math.ceil(settings.expire_s),
        "device": {
            "identifiers": [node],
            "name": f"{settings.prefix} {settings.camera}",
            "manufacturer": "doorstate",
            "model": "doors seen by a depth camera",
            "sw_version": __version__,
        },
        "origin": {"name": "doorstate", "sw_version": __version__},
    }
    binary = {
        "name": door,
        "unique_id": f"{node}_{name}",
        "device_class": "door",
        "payload_on": _ON,
        "payload_off": _OFF,
        "value_template": _binary_template(settings),
    }
    three = {
        "name": f"{door} state",
        "unique_id": f"{node}_{name}_state",
        "device_class": "enum",
        "options": list(STATES),
        "value_template": f"{{{{ None if value == '{UNKNOWN}' else value }}}}",
    }
    return [
        Message(f"{settings.discovery_prefix}/binary_sensor/{node}/{name}/config", to_json(common | binary)),
        Message(f"{settings.discovery_prefix}/sensor/{node}/{name}/config", to_json(common | three)),
    ]


def _binary_template(settings: MqttSettings) -> str:
    words = {
        DoorState.OPEN: _ON,
        DoorState.SEMI_OPEN: _BINARY[settings.semi_open],
        DoorState.CLOSED: _OFF,
    }
    pairs = ", ".join(f"'{state}': '{word}'" for state, word in words.items())
    return f"{{{{ {{{pairs}}}.get(value, '{_NONE}') }}}}"
