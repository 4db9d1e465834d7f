# SPDX-License-Identifier: Apache-2.0
"""Uvicorn server with a listening socket of its own, guarded connections and dated log lines."""

from __future__ import annotations

import math
import signal
import socket
from typing import TYPE_CHECKING

import uvicorn

from doorstate.errors import DoorstateError
from doorstate.serving.connections import guarded_protocol
from doorstate.serving.limits import Limits
from doorstate.serving.logs import log_config

if TYPE_CHECKING:
    from fastapi import FastAPI

# Longer than clients (httpx: 5 s) and proxies (nginx: 60 s) keep an idle connection. If the service closes it first,
# a request sent at that moment is lost to a reset.
KEEP_ALIVE_S = 75
_MAX_HEAD_BYTES = 16 * 1024
_SPARE_S = 3


def create_server(app: FastAPI, limits: Limits, verbose: bool = False) -> uvicorn.Server:
    """Return a server.

    Args:
        app: application to serve.
        limits: limits of the service.
        verbose: log requests on standard error.
    """
    return uvicorn.Server(
        uvicorn.Config(
            app,
            http=guarded_protocol(limits),
            ws="none",
            log_config=log_config(verbose),
            access_log=verbose,
            h11_max_incomplete_event_size=_MAX_HEAD_BYTES,
            timeout_keep_alive=KEEP_ALIVE_S,
            # A request ends by its own limit first: Uvicorn would end it with a traceback.
            timeout_graceful_shutdown=math.ceil(limits.timeout_s) + _SPARE_S,
        )
    )


def stop_on_signals(server: uvicorn.Server) -> None:
    """Let SIGINT and SIGTERM end the server with exit code 0, after the requests in progress."""
    # Uvicorn stops at these signals, and raises them again when it has stopped, which would look like a failure.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: setattr(server, "should_exit", True))


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Raises:
        DoorstateError: the address or port cannot be used.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family, backlog=1024)
    except OSError as error:
        reason = str(error.strerror or error).partition(" (while")[0]  # Python repeats the address there
        raise DoorstateError(f"cannot listen on {host}, port {port}: {reason}") from error
    # Connections inherit this. asyncio sets it only for sockets of its own; without it the second part of a response
    # waits 40 ms until the client acknowledges the first.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
