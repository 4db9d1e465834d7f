# SPDX-License-Identifier: Apache-2.0
"""Middleware for responses that are sent before the request was received completely."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from starlette.types import ASGIApp, Message, Receive, Scope, Send

_LINGER_S = 2.0
_LINGER_BYTES = 2**20


class LingeringClose:
    """ASGI middleware: after an early response, discard the rest of the request for two seconds or 1 MiB, then close.

    Closing at once would reset the connection, and the client might never see the response (RFC 9112, section 9.6).
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        unread = b"transfer-encoding" in headers or headers.get(b"content-length", b"0") != b"0"

        async def tracked_receive() -> Message:
            nonlocal unread
            message = await receive()
            unread = message["type"] == "http.request" and message.get("more_body", False)
            return message

        async def lingering_send(message: Message) -> None:
            if unread and message["type"] == "http.response.start":
                message = dict(message) | {"headers": [*message["headers"], (b"connection", b"close")]}
            elif unread and not message.get("more_body", False):
                await send(dict(message) | {"more_body": True})
                message = {"type": "http.response.body", "body": b""}
                with suppress(TimeoutError):
                    async with asyncio.timeout(_LINGER_S):
                        discarded = 0
                        while unread and discarded < _LINGER_BYTES:
                            discarded += len((await tracked_receive()).get("body", b""))
            await send(message)

        await self._app(scope, tracked_receive, lingering_send)
