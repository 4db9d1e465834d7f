# SPDX-License-Identifier: Apache-2.0
"""A page on this machine's own address that shows clouds as they come in, by server-sent events."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any

from doorstate.errors import ConfigError

_KEPT = 100  # events for a browser that comes late or is slow; older ones it never sees
_BREATH_S = 5.0  # a comment is sent after so long without an event, to notice that a browser has gone
_OUR_NAMES = {"127.0.0.1", "localhost"}


class LivePage:
    """Serves one page to any number of browsers on this machine while it is entered.

    Args:
        page: HTML that listens to `events`.
        port: 0 takes any that is free.

    Raises:
        ConfigError: the port cannot be had.
    """

    def __init__(self, page: str, port: int = 0) -> None:
        self._events: deque[tuple[int, str, str]] = deque(maxlen=_KEPT)  # number, kind, JSON
        self._number = time.time_ns() // 10**6  # above those of a server before, for browsers that knew it
        self._changed = threading.Condition()
        self._open = True
        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), _handler(self, page.encode()))
        except OSError as error:
            raise ConfigError(
                f"--port {port}: {error.strerror or error}; 0 takes any that is free"
            ) from error
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/"

    def __enter__(self) -> LivePage:
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._changed:
            self._open = False
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def publish(self, kind: str, content: Any) -> None:
        """Send an event to every browser.

        Args:
            kind: `cloud`, with an entry of the view, or `end`, when no more will come.
            content: as JSON takes it.
        """
        text = json.dumps(content)
        with self._changed:
            self._number += 1
            self._events.append((self._number, kind, text))
            self._changed.notify_all()

    def events_after(self, last: int) -> Iterator[str]:
        """Events kept after a number, and those to come, until the page is closed."""
        while self._open:
            with self._changed:
                if not self._news(last):
                    self._changed.wait(_BREATH_S)
                new = self._news(last)
            for number, kind, text in new:
                last = number
                yield f"id: {number}\nevent: {kind}\ndata: {text}\n\n"
            if not new:
                yield ": still here\n\n"

    def _news(self, last: int) -> list[tuple[int, str, str]]:
        return [event for event in self._events if event[0] > last]


def _handler(live: LivePage, page: bytes) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            with suppress(ConnectionError):  # the browser has gone
                self._answer()

        def _answer(self) -> None:
            # A page of somebody else that gave its name our address must not read what the robot sees.
            if self.headers.get("Host", "").split(":")[0] not in _OUR_NAMES:
                self.send_error(HTTPStatus.FORBIDDEN, "Ask for 127.0.0.1 or localhost")
            elif self.path == "/":
                self._begin("text/html; charset=utf-8")
                self.wfile.write(page)
            elif self.path == "/events":
                self._begin("text/event-stream")
                self._send_events()
            else:
                self.send_error(HTTPStatus.NOT_FOUND)

        def _begin(self, content_type: str) -> None:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", content_type)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()

        def _send_events(self) -> None:
            last = self.headers.get("Last-Event-ID", "")  # of a browser that lost the connection
            for text in live.events_after(int(last) if last.isdecimal() else 0):
                self.wfile.write(text.encode())

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing: standard error is the command's."""

    return Handler
