# SPDX-License-Identifier: Apache-2.0
"""An answer given before the client has sent everything must reach it, and must not wait for it."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from starlette.types import ASGIApp, Message, Receive, Scope, Send

_LINGER_S = 2.0


class LingeringClose:
    """ASGI middleware: after an early answer throws away what still comes, for two seconds, and closes the connection.

    To close at once would reset the connection, and the client would see that in place of the answer (RFC 9112, 9.6).
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        headers = dict(scope["headers"])
        unread = b"transfer-encoding" in headers or headers.get(b"content-length", b"0") != b"0"

        async def watched_receive() -> Message:
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
                        while unread:
                            await watched_receive()
            await send(message)

        await self._app(scope, watched_receive, lingering_send)
        return None
