# SPDX-License-Identifier: Apache-2.0
"""Connection to a broker that comes back by itself, for one thread.

Messages have quality of service 0: one that is lost with a connection is not sent again later, when it is old. The
publisher sends the newest states after each connection instead.
"""

from __future__ import annotations

import math
import ssl
import time
from collections.abc import Callable, Iterable
from typing import Any

from doorstate.errors import BrokerError, needs_extra, summarize_exception
from doorstate.mqtt.settings import MqttSettings
from doorstate.mqtt.topics import OFFLINE, Message, availability_topic, identifier

with needs_extra("MQTT"):
    import paho.mqtt.client as paho
    from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties
    from paho.mqtt.reasoncodes import ReasonCode

CONNECT_TIMEOUT_S = 5.0
_FIRST_WAIT_S, _MAX_WAIT_S = 0.5, 30.0  # between attempts; doubled each time
_FINISH_S = 1.0
_LOCAL = {"localhost", "127.0.0.1", "::1"}
_SHORT_S = 3.0  # a connection that is lost so soon does not shorten the wait
_TAKEN_OVER = 142  # MQTT 5.0, 3.14.2.1
_SAME_NAME = "another program may publish for the same camera"  # old brokers do not tell
_FATAL = {
    132: "does not speak version 5 of MQTT",
    133: "refuses the name of this client",
    134: "refuses this user or password",
    135: "refuses this user or password",
    140: "asks for another way of authentication",
}
"""Codes of a refused connection that no second attempt changes (MQTT 5.0, 3.2.2.2)."""


class Connection:
    """Connection of one publisher.

    Args:
        settings: broker, and the camera of the last will.
        notify: gets one line when the connection is made, lost or refused.

    Raises:
        MissingExtraError: paho-mqtt is not installed.
        BrokerError: the certificates of authorities cannot be read.
    """

    def __init__(self, settings: MqttSettings, notify: Callable[[str], None]) -> None:
        self._settings, self._notify = settings, notify
        self.is_up = False
        self._has_come_up = False
        self.refusal: BrokerError | None = None  # of the newest attempt
        self._is_open = False  # the socket
        self._up_s = -math.inf  # since when it is up
        self._deadline_s = math.inf  # of the answer to a request for a connection
        self._retry_s, self._wait_s = -math.inf, _FIRST_WAIT_S
        self._reason = self._complaint = ""
        self._client = self._create_client()

    @property
    def warns_of_password(self) -> bool:
        """True if a password is sent through a network without encryption."""
        return (
            self._settings.password is not None
            and not self._settings.tls
            and self._settings.host not in _LOCAL
        )

    @property
    def is_busy(self) -> bool:
        """True while the network takes no more."""
        return self._client.want_write()

    @property
    def is_connecting(self) -> bool:
        """True while an attempt has neither succeeded nor failed."""
        return self._is_open and not self.is_up

    def take_come_up(self) -> bool:
        """Return True once for each connection."""
        has_come_up, self._has_come_up = self._has_come_up, False
        return has_come_up

    def step(self, now_s: float, timeout_s: float) -> bool:
        """Send, receive, keep alive, and connect where it is time to.

        Args:
            now_s: time on a steady clock.
            timeout_s: longest time to wait for the network; connecting may take longer.

        Returns:
            True if the network was waited for.
        """
        if not self._is_open:
            if now_s < self._retry_s:
                return False
            self._open(now_s)
            return True
        if now_s > self._deadline_s:
            self._lose(now_s, "no answer")
            return True
        try:
            code = self._client.loop(timeout_s)
        except Exception as error:  # of any type, for bytes that are no MQTT
            self._lose(now_s, summarize_exception(error))
            return True
        if code != MQTTErrorCode.MQTT_ERR_SUCCESS or not self._is_open:
            is_short = self.is_up and now_s - self._up_s < _SHORT_S
            self._lose(now_s, self._reason or (_SAME_NAME if is_short else paho.error_string(code)))
        return True

    def send(self, message: Message) -> None:
        """Hand a message to the network; without a connection it is dropped."""
        properties = None
        if message.expiry_s is not None:
            properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
            properties.MessageExpiryInterval = math.ceil(message.expiry_s)
        self._client.publish(message.topic, message.payload, qos=0, retain=True, properties=properties)

    def finish(self, messages: Iterable[Message]) -> None:
        """Send the last messages, if the network takes them in time, and end the connection without the last will."""
        for message in messages if self.is_up else ():
            self.send(message)
        deadline_s = time.monotonic() + _FINISH_S
        while self._is_open and self._client.want_write() and time.monotonic() < deadline_s:
            self._client.loop(_FINISH_S / 10)
        if self._is_open:
            self._client.disconnect()
            self._client.loop(_FINISH_S / 10)
        self.is_up = self._is_open = False
        # Without a cycle of references, its sockets are closed at once.
        self._client.on_connect = self._client.on_disconnect = None

    def _create_client(self) -> paho.Client:
        settings = self._settings
        client = paho.Client(
            CallbackAPIVersion.VERSION2,
            client_id=identifier(f"{settings.prefix}_{settings.camera}"),
            protocol=paho.MQTTv5,
        )
        client.connect_timeout = CONNECT_TIMEOUT_S
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        if settings.user is not None:
            password = None if settings.password is None else settings.password.get_secret_value()
            client.username_pw_set(settings.user, password)
        if settings.tls:
            try:
                client.tls_set_context(
                    ssl.create_default_context(cafile=settings.ca_file and str(settings.ca_file))
                )
            except OSError as error:  # also without a certificate in the file
                raise BrokerError("is no file of certificates", path=settings.ca_file) from error
        client.will_set(availability_topic(settings), OFFLINE, qos=1, retain=True)
        return client

    def _open(self, now_s: float) -> None:
        keepalive_s = max(5, math.ceil(self._settings.expire_s))
        self.refusal, self._reason, self._deadline_s = None, "", now_s + 2 * CONNECT_TIMEOUT_S
        try:
            self._client.connect(self._settings.host, self._settings.port, keepalive_s)
            self._is_open = True
        except (OSError, ValueError) as error:  # ValueError: a name that cannot be encoded
            reason = getattr(error, "verify_message", "") or getattr(error, "strerror", None) or str(error)
            if isinstance(error, ssl.SSLError):
                self.refusal = self._error(f"no TLS with the broker: {reason}")
            self._lose(now_s, reason)

    def _lose(self, now_s: float, reason: str) -> None:
        """Say that there is no connection, once for each reason, and wait before the next attempt."""
        was_up, self.is_up, self._is_open = self.is_up, False, False
        if was_up and now_s - self._up_s >= _SHORT_S:
            self._wait_s = _FIRST_WAIT_S
        self._retry_s = now_s + self._wait_s
        self._wait_s = min(2 * self._wait_s, _MAX_WAIT_S)
        verb = "lost" if was_up else "has no connection to"
        complaint = f"{verb} the broker {self._settings.address} ({reason})"
        if complaint != self._complaint:
            self._complaint = complaint
            self._notify(f"{complaint}; trying again")

    def _on_connect(
        self, client: paho.Client, data: Any, flags: Any, code: ReasonCode, properties: Any
    ) -> None:
        if code.is_failure:
            self._reason = _FATAL.get(code.value, f"answers: {code}")
            if code.value in _FATAL:  # others, such as busy, may pass
                self.refusal = self._error(f"the broker {self._reason}")
            return
        self.is_up = self._has_come_up = True
        self._deadline_s, self._up_s, self._complaint = math.inf, time.monotonic(), ""
        self._notify(f"connected to the broker {self._settings.address}")

    def _on_disconnect(
        self, client: paho.Client, data: Any, flags: Any, code: ReasonCode, properties: Any
    ) -> None:
        self._is_open = False
        if code.value == _TAKEN_OVER:
            self._reason = _SAME_NAME

    def _error(self, message: str) -> BrokerError:
        return BrokerError(f"{self._settings.address}: {message}")
