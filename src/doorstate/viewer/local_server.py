# SPDX-License-Identifier: Apache-2.0
"""HTTP server of a page for browsers on this machine."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any, Self

from doorstate.errors import ConfigError

_LOCAL_NAMES = {"127.0.0.1", "localhost"}


class LocalServer:
    """Server on the loopback interface, as a context manager.

    Args:
        handler: answers requests.
        port: port to listen on; 0 chooses a free one.

    Raises:
        ConfigError: the port cannot be used.
    """

    def __init__(self, handler: type[BaseHTTPRequestHandler], port: int = 0) -> None:
        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), handler)
        except OSError as error:
            raise ConfigError(
                f"cannot listen on port {port}: {error.strerror or error}", field="port"
            ) from error
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/"

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


def is_local(headers: Mapping[str, str] | Any) -> bool:
    """Return True if a request names this machine as its host.

    DNS rebinding: a foreign page whose name resolves to this address must not read what is served.
    """
    return headers.get("Host", "").split(":")[0] in _LOCAL_NAMES
