# SPDX-License-Identifier: Apache-2.0
"""HTTP server on this machine for a page that gets clouds as server-sent events."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from types import TracebackType
from typing import Any, Literal

from doorstate.viewer.local_server import LocalServer, is_local

_KEPT_EVENTS = 100  # for browsers that connect late or are slow
_KEEP_ALIVE_S = 5.0  # a comment after this time without an event reveals a closed connection


class LivePage(LocalServer):
    """Server of one page to any number of browsers on this machine, as a context manager.

    Args:
        page: HTML that listens to `events`.
        port: port to listen on; 0 chooses a free one.

    Raises:
        ConfigError: the port cannot be used.
    """

    def __init__(self, page: str, port: int = 0) -> None:
        self._events: deque[tuple[int, str, str]] = deque(maxlen=_KEPT_EVENTS)  # number, kind, JSON
        # Numbers start above those of an earlier server, which a browser may remember.
        self._number = time.time_ns() // 10**6
        self._changed = threading.Condition()
        self._open = True
        super().__init__(_handler_class(self, page.encode()), port)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._changed:
            self._open = False
            self._changed.notify_all()
        super().__exit__(kind, error, trace)

    def publish(self, kind: Literal["cloud", "end"], content: object) -> None:
        """Send an event to all browsers.

        Args:
            kind: `cloud` with an entry of the cloud page, or `end` after the last one.
            content: value that JSON can hold.
        """
        text = json.dumps(content)
        with self._changed:
            self._number += 1
            self._events.append((self._number, kind, text))
            self._changed.notify_all()

    def events_after(self, number: int) -> Iterator[str]:
        """Yield the kept events after a number, then new ones, until the server is closed."""
        while self._open:
            with self._changed:
                if not self._newer(number):
                    self._changed.wait(_KEEP_ALIVE_S)
                events = self._newer(number)
            for number, kind, text in events:
                yield f"id: {number}\nevent: {kind}\ndata: {text}\n\n"
            if not events:
                yield ": keep-alive\n\n"

    def _newer(self, number: int) -> list[tuple[int, str, str]]:
        return [event for event in self._events if event[0] > number]


def _handler_class(live: LivePage, page: bytes) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            with suppress(ConnectionError):  # the browser closed the connection
                self._respond()

        def _respond(self) -> None:
            if not is_local(self.headers):
                self.send_error(HTTPStatus.FORBIDDEN, "Host must be 127.0.0.1 or localhost")
            elif self.path == "/":
                self._send_head("text/html; charset=utf-8")
                self.wfile.write(page)
            elif self.path == "/events":
                self._send_head("text/event-stream")
                self._send_events()
            else:
                self.send_error(HTTPStatus.NOT_FOUND)

        def _send_head(self, content_type: str) -> None:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", content_type)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()

        def _send_events(self) -> None:
            last = self.headers.get("Last-Event-ID", "")  # sent by a browser that reconnects
            for text in live.events_after(int(last) if last.isdecimal() else 0):
                self.wfile.write(text.encode())

        def log_message(self, format: str, *args: Any) -> None:
            """Log nothing."""

    return Handler
