# SPDX-License-Identifier: Apache-2.0
"""Options of states on MQTT, for commands that follow a stream."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.shared_options import with_shared_options
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.mqtt.publisher import MqttPublisher
    from doorstate.mqtt.settings import MqttSettings

_PASSWORD = "DOORSTATE_MQTT_PASSWORD"
_OFF = "off"


@dataclass(frozen=True)
class MqttOptions:
    """What a user says of MQTT; `settings` is None without a broker."""

    settings: MqttSettings | None

    @contextmanager
    def open(self) -> Iterator[MqttPublisher | None]:
        """Yield a connected publisher, which says on standard error what becomes of the connection; None without one.

        Raises:
            MissingExtraError: paho-mqtt is not installed.
            BrokerError: the broker refuses user, password or TLS.
        """
        if self.settings is None:
            yield None
            return
        from doorstate.cli.console import stderr
        from doorstate.mqtt.publisher import MqttPublisher

        with MqttPublisher(self.settings, lambda line: stderr.print(f"mqtt: {line}")) as publisher:
            yield publisher


def read_mqtt_options(
    mqtt: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Publish the state on MQTT: mqtt://[USER@]HOST[:PORT], or mqtts:// with TLS. The password comes from"
            f" a file or from {_PASSWORD}.",
        ),
    ] = None,
    mqtt_camera: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the camera in topics; each camera has its own.")
    ] = "camera",
    mqtt_prefix: Annotated[str, typer.Option(metavar="TOPIC", help="Beginning of all topics.")] = "doorstate",
    mqtt_discovery: Annotated[
        str, typer.Option(metavar="TOPIC", help=f"Discovery prefix of Home Assistant, or {_OFF}.")
    ] = "homeassistant",
    mqtt_semi_open: Annotated[
        str,
        typer.Option(
            metavar="STATE",
            help="What a semi-open door is in Home Assistant's door sensor: open, closed or unknown.",
        ),
    ] = "open",
    mqtt_expire_s: Annotated[
        float,
        typer.Option(
            help="Time after which a state that is not confirmed counts no more; the camera is offline after a third"
            " of it.",
            min=1,
        ),
    ] = 15.0,
    mqtt_password_file: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File that holds the password.")
    ] = None,
    mqtt_ca: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Certificates of authorities for TLS. [default: the system's]"),
    ] = None,
) -> MqttOptions:
    """Return the options that a user typed.

    Raises:
        ConfigError: an option has no such value, or options exclude each other.
    """
    if mqtt is None:
        if mqtt_password_file is not None or mqtt_ca is not None:
            raise ConfigError("--mqtt-password-file and --mqtt-ca need --mqtt")
        return MqttOptions(None)
    from pydantic import ValidationError

    from doorstate.mqtt.settings import MqttSettings, parse_address, read_password

    address = parse_address(mqtt)
    password = None if mqtt_password_file is None else read_password(mqtt_password_file)
    if mqtt_ca is not None and not address.tls:
        raise ConfigError("--mqtt-ca needs an address that begins with mqtts://")
    try:
        settings = MqttSettings.model_validate(
            address.model_dump()
            | {
                "password": password or os.environ.get(_PASSWORD) or None,
                "ca_file": mqtt_ca,
                "camera": mqtt_camera,
                "prefix": mqtt_prefix,
                "discovery_prefix": None if mqtt_discovery == _OFF else mqtt_discovery,
                "semi_open": mqtt_semi_open,
                "expire_s": mqtt_expire_s,
                "silence_s": mqtt_expire_s / 3,
            }
        )
    except ValidationError as error:
        problem = error.errors()[0]
        if not problem["loc"]:
            raise ConfigError("a password needs a user", field="mqtt", expected="mqtt://USER@HOST") from error
        raise ConfigError(
            f"cannot use {problem['input']!r}", field=f"mqtt_{str(problem['loc'][0]).removesuffix('_prefix')}"
        ) from error
    return MqttOptions(settings)


with_mqtt_options = with_shared_options(read_mqtt_options, "mqtt")
