# SPDX-License-Identifier: Apache-2.0
"""Broker, camera and times of a publisher."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self
from urllib.parse import unquote, urlsplit

from pydantic import Field, SecretStr, model_validator

from doorstate._input import read_input_text
from doorstate._models import FrozenModel
from doorstate.errors import ConfigError

Level = Annotated[str, Field(pattern=r"^[^/+#$\x00-\x1f\x7f][^/+#\x00-\x1f\x7f]{0,99}$")]
"""One level of a topic."""
Prefix = Annotated[str, Field(pattern=r"^[^/+#$\x00-\x1f\x7f][^+#\x00-\x1f\x7f]{0,199}$")]
"""Beginning of topics, of one or several levels."""
Binary = Literal["open", "closed", "unknown"]

_PORTS = {"mqtt": 1883, "mqtts": 8883}
_MAX_PASSWORD_BYTES = 65_535  # as in the protocol


class MqttSettings(FrozenModel):
    """How states are published.

    Attributes:
        host, port: of the broker.
        tls: encrypt the connection, and check the broker's certificate and name.
        ca_file: certificates of authorities; None for those of the system.
        user, password: None for a broker that asks for none.
        camera: name of the camera; each camera has a connection of its own.
        prefix: beginning of all topics.
        discovery_prefix: beginning of the topics of Home Assistant's discovery; None for no discovery.
        semi_open: what a semi-open door is to programs that know open and closed only.
        expire_s: time after which a state that is not confirmed counts no more, here, at the broker and in Home
            Assistant.
        silence_s: time without a cloud after which the camera counts as gone.
    """

    host: str = Field("localhost", min_length=1, max_length=253)
    port: int = Field(1883, ge=1, le=65535)
    tls: bool = False
    ca_file: Path | None = None
    user: str | None = None
    password: SecretStr | None = None
    camera: Level = "camera"
    prefix: Prefix = "doorstate"
    discovery_prefix: Prefix | None = "homeassistant"
    semi_open: Binary = "open"
    expire_s: float = Field(15.0, ge=1, le=86_400)
    silence_s: float = Field(5.0, gt=0, le=86_400)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.password is not None and self.user is None:
            raise ValueError("a password needs a user")
        return self

    @property
    def refresh_s(self) -> float:
        """Time after which a state that stays the same is sent again."""
        return self.expire_s / 3

    @property
    def address(self) -> str:
        """Host and port of the broker, for messages."""
        return f"{f'[{self.host}]' if ':' in self.host else self.host}:{self.port}"


class BrokerAddress(FrozenModel):
    """What the address of a broker says, `mqtt://[USER@]HOST[:PORT]` or `mqtts://` for TLS."""

    host: str
    port: int
    tls: bool
    user: str | None = None


def parse_address(text: str) -> BrokerAddress:
    """Read the address of a broker.

    Raises:
        ConfigError: it is none, or it has a password, which lists of processes would show.
    """
    try:
        parts = urlsplit(text if "://" in text else f"mqtt://{text}")
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or parts.scheme not in _PORTS or parts.path.strip("/") or parts.query or parts.fragment:
        raise ConfigError(
            "is no address of a broker",
            field="mqtt",
            expected="mqtt://[USER@]HOST[:PORT], or mqtts:// with TLS",
        )
    if parts.password is not None:
        raise ConfigError(
            "has a password, which lists of processes show",
            field="mqtt",
            hint="put it into a file, or into the environment variable DOORSTATE_MQTT_PASSWORD",
        )
    user = unquote(parts.username) if parts.username else None
    return BrokerAddress(host=host, port=port or _PORTS[parts.scheme], tls=parts.scheme == "mqtts", user=user)


def read_password(path: Path) -> SecretStr:
    """Read a password from a file; a line break at its end does not count.

    Raises:
        ConfigError: the file cannot be read, or is empty.
    """
    text = re.sub(r"\r?\n\Z", "", read_input_text(path, _MAX_PASSWORD_BYTES, ConfigError))
    if not text:
        raise ConfigError("holds no password", path=path)
    return SecretStr(text)
