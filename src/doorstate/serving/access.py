# SPDX-License-Identifier: Apache-2.0
"""Middleware for permissions of clients and security headers."""

from __future__ import annotations

import hmac
import ipaddress
import re
import socket
from collections.abc import Collection
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from doorstate.errors import ConfigError

_TOKEN = re.compile(r"[\x21-\x7e]+")
_OPEN_PATHS = {"/health"}  # for load balancers and supervisors, without a token
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


@dataclass(frozen=True)
class Access:
    """Permissions of clients.

    Args:
        hosts: names in the Host header, besides addresses, localhost and the name of this machine. A web page whose
            name resolves to this machine (DNS rebinding) has another name.
        token: bearer token of every request but `/health`; None asks for none.

    Raises:
        ConfigError: the token is empty, or has characters that no header can hold.
    """

    hosts: Collection[str] = ()
    token: str | None = None

    def __post_init__(self) -> None:
        # Anybody can send an empty one: it is that of a variable that was not set.
        if self.token is not None and not _TOKEN.fullmatch(self.token):
            raise ConfigError(
                "is no token", field="token", expected="letters, digits and signs, without blanks"
            )

    def allows_host(self, host: str) -> bool:
        """Return True if a Host header is served."""
        try:
            name = (urlsplit(f"//{host}").hostname or "").rstrip(".")
        except ValueError:
            return False
        own = {"localhost", socket.gethostname().lower(), *(allowed.lower() for allowed in self.hosts)}
        return name in own or _is_address(name)

    def allows_token(self, authorization: str) -> bool:
        """Return True if an Authorization header has the token."""
        if self.token is None:
            return True
        scheme, _, token = authorization.partition(" ")
        return scheme.lower() == "bearer" and hmac.compare_digest(token.strip().encode(), self.token.encode())


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class AccessControl:
    """ASGI middleware: refuse foreign hosts and missing tokens, and add security headers to every response."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        refusal = self._refusal(scope)
        await (refusal or self._app)(scope, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> JSONResponse | None:
        headers = Headers(scope=scope)
        if not self._access.allows_host(headers.get("host", "")):
            return JSONResponse({"error": "the Host header names another machine"}, 421)
        if scope["path"] not in _OPEN_PATHS and not self._access.allows_token(
            headers.get("authorization", "")
        ):
            return JSONResponse(
                {"error": "a bearer token is needed"}, 401, {"WWW-Authenticate": 'Bearer realm="doorstate"'}
            )
        return None
