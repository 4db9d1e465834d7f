# SPDX-License-Identifier: Apache-2.0
"""HTTP server on this machine for the page that labels frames.

Other pages in the same browser can send requests to this machine. Every address holds a random token, so that they
cannot guess one; the host and the origin of a request must be this server, and changes must be JSON.
"""

from __future__ import annotations

import json
import re
import secrets
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any, TypeVar

from pydantic import ValidationError

from doorstate.errors import ConfigError, DoorstateError, WriteParameter, python_parameter
from doorstate.pages.colors import STATE_COLORS
from doorstate.pages.document import fill_page
from doorstate.types import STATES
from doorstate.viewer.label_session import GivenBox, GivenLabels, LabelledBeforeError, LabelSession
from doorstate.viewer.local_server import LocalServer, is_local

_TOKEN_BYTES = 24
_MAX_BODY_BYTES = 100_000
_PATH = re.compile(r"/frames/(\d{1,9})(/place)?|/undo|/")
Result = TypeVar("Result")


class LabelPage(LocalServer):
    """Server of the page that labels frames, as a context manager.

    Args:
        session: frames and their labels, used by the worker alone.
        worker: executor with one thread, in which the session was made.
        count: frames of the session.
        start: number of the frame to open.
        title: name of the folder or bag.
        port: port to listen on; 0 chooses a free one.
        parameter: how errors write parameters.

    Raises:
        ConfigError: the port cannot be used.
    """

    def __init__(
        self,
        session: LabelSession,
        worker: Executor,
        count: int,
        start: int = 0,
        title: str = "",
        port: int = 0,
        parameter: WriteParameter = python_parameter,
    ) -> None:
        self.session, self.parameter = session, parameter
        self.token = secrets.token_urlsafe(_TOKEN_BYTES)
        self.page = render_label_page(start, title).encode()
        self._worker, self._count = worker, count
        self._ahead: Future[Any] | None = None
        super().__init__(type("Handler", (_Handler,), {"page": self}), port)
        self.origin = self.address.rstrip("/")
        self.address += f"{self.token}/"

    def run(self, work: Callable[[], Result]) -> Result:
        """Return the result of a call of the session, in the worker; a frame that was to be read ahead is left."""
        if self._ahead is not None:
            self._ahead.cancel()
        return self._worker.submit(work).result()

    def show(self, number: int) -> dict[str, Any] | None:
        """Return a frame, and read the next one ahead; None without such a frame."""
        if not 0 <= number < self._count:
            return None
        shown = self.run(lambda: self.session.show(number))
        if number + 1 < self._count:
            self._ahead = self._worker.submit(self.session.open, number + 1)
        return shown


def render_label_page(start: int, title: str) -> str:
    """Return the page, which gets its frames from the server that sent it."""
    return fill_page(
        "label.html",
        "doorstate.viewer",
        ("page.css", "label.css", "clouds.js", "label_views.js", "label.js"),
        live=True,
        title=title,
        page_data={"start": start, "states": STATES, "state_colors": STATE_COLORS},
    )


class _Handler(BaseHTTPRequestHandler):
    page: LabelPage
    timeout = 60.0

    def do_GET(self) -> None:
        with suppress(ConnectionError):  # the browser closed the connection
            path = self._path()
            if path == "/":
                self._send(HTTPStatus.OK, self.page.page, "text/html; charset=utf-8")
            elif path is not None and (match := re.fullmatch(r"/frames/(\d+)", path)):
                self._answer(lambda: self.page.show(int(match[1])))
            elif path is not None:
                self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        with suppress(ConnectionError):
            path = self._path()
            if path is not None and (body := self._body()) is not None:
                self._answer(lambda: self._change(path, body))

    def _change(self, path: str, body: bytes) -> Any:
        match = _PATH.fullmatch(path)
        session = self.page.session
        if match is None or path == "/":
            return None
        if path == "/undo":
            return {"number": self.page.run(session.undo)}
        number = int(match[1])
        if number >= self.page._count:
            return None
        if match[2]:
            box = GivenBox.model_validate_json(body)
            return self.page.run(lambda: session.place(number, box))
        labels = GivenLabels.model_validate_json(body)
        self.page.run(lambda: session.save(number, labels))
        return {"saved": True}

    def _path(self) -> str | None:
        """Return the path after the token, or None once a request that is not from this page was refused."""
        token, _, rest = self.path.removeprefix("/").partition("/")
        own = {self.page.origin, self.page.origin.replace("127.0.0.1", "localhost")}
        is_own = is_local(self.headers) and self.headers.get("Origin", self.page.origin) in own
        if is_own and secrets.compare_digest(token.encode(), self.page.token.encode()):
            return f"/{rest}"
        self._refuse(HTTPStatus.FORBIDDEN)
        return None

    def _body(self) -> bytes | None:
        length = self.headers.get("Content-Length", "")
        if self.headers.get("Content-Type") != "application/json" or not length.isdecimal():
            self._refuse(HTTPStatus.BAD_REQUEST)
        elif int(length) > _MAX_BODY_BYTES:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        else:
            return self.rfile.read(int(length))
        return None

    def _answer(self, work: Callable[[], Any]) -> None:
        """Send the result of some work as JSON, or its error."""
        try:
            result = work()
        except LabelledBeforeError as error:
            self._send_json(HTTPStatus.CONFLICT, {"error": error.message})
        except (ValidationError, ConfigError) as error:
            text = error.describe(self.page.parameter) if isinstance(error, ConfigError) else "not valid"
            self._send_json(HTTPStatus.BAD_REQUEST, {"error": text})
        except DoorstateError as error:
            text = error.describe(self.page.parameter)
            self._send_json(HTTPStatus.INTERNAL_SERVER_ERROR, {"error": text})
        else:
            if result is None:
                self._refuse(HTTPStatus.NOT_FOUND)
            else:
                self._send_json(HTTPStatus.OK, result)

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True
        self._send_json(status, {"error": status.phrase})

    def _send_json(self, status: HTTPStatus, content: object) -> None:
        self._send(status, json.dumps(content).encode(), "application/json")

    def _send(self, status: HTTPStatus, content: bytes, content_type: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", content_type)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("X-Frame-Options", "DENY")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing."""
