# SPDX-License-Identifier: Apache-2.0
"""Topics and payloads: docs/mqtt.md."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from doorstate.errors import ConfigError
from doorstate.mqtt.settings import MqttSettings

ONLINE, OFFLINE, UNKNOWN = "online", "offline", "unknown"
_LEVEL = re.compile(r"[^/+#$\x00-\x1f\x7f][^/+#\x00-\x1f\x7f]{0,99}")
_PLAIN = re.compile(r"[A-Za-z0-9_-]+")


class Message(NamedTuple):
    """A retained message; the broker forgets it after `expiry_s`, if that is given."""

    topic: str
    payload: str
    expiry_s: float | None = None


def availability_topic(settings: MqttSettings) -> str:
    """Topic that says if the camera delivers: `online` or `offline`."""
    return f"{settings.prefix}/{settings.camera}/availability"


def state_topic(settings: MqttSettings, door: str) -> str:
    """Topic of the state's name, or `unknown`."""
    return f"{settings.prefix}/{settings.camera}/{door}/state"


def attributes_topic(settings: MqttSettings, door: str) -> str:
    """Topic of all that is known of the door, as JSON."""
    return f"{settings.prefix}/{settings.camera}/{door}/attributes"


def check_level(name: str) -> str:
    """Return the name of a door, if it can be one level of a topic.

    Raises:
        ConfigError: it cannot.
    """
    if _LEVEL.fullmatch(name) is None or name == "availability":
        raise ConfigError(
            f"{name!r} cannot be the name of a door on MQTT",
            expected="1 to 100 characters without / + #, not beginning with $",
        )
    return name


def identifier(name: str) -> str:
    """Return a name of letters, digits, _ and - alone, another one for each name."""
    if _PLAIN.fullmatch(name):
        return name
    digest = hashlib.sha256(name.encode()).hexdigest()[:6]
    return f"{re.sub('[^A-Za-z0-9_-]+', '_', name).strip('_') or 'door'}_{digest}"


def to_json(record: Mapping[str, Any]) -> str:
    """Return JSON in one line, without spaces."""
    return json.dumps(record, ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=str)
