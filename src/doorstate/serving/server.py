# SPDX-License-Identifier: Apache-2.0
"""Uvicorn server with a listening socket of its own."""

from __future__ import annotations

import math
import signal
import socket
from typing import TYPE_CHECKING

import uvicorn

from doorstate.errors import DoorstateError

if TYPE_CHECKING:
    from fastapi import FastAPI

# Longer than clients (httpx: 5 s) and proxies (nginx: 60 s) keep an idle connection. If the service closes it first,
# a request sent at that moment is lost to a reset.
KEEP_ALIVE_S = 75


def create_server(app: FastAPI, timeout_s: float, verbose: bool = False) -> uvicorn.Server:
    """Return a server that ends with exit code 0 on SIGINT and SIGTERM, after the requests in progress.

    Args:
        app: application to serve.
        timeout_s: longest time of a request.
        verbose: log requests on standard error.
    """
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            http="h11",
            ws="none",
            log_level="info" if verbose else "warning",
            access_log=verbose,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=math.ceil(timeout_s),
        )
    )
    # Uvicorn stops at these signals, and raises them again when it has stopped, which would look like a failure.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: setattr(server, "should_exit", True))
    return server


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Raises:
        DoorstateError: the address or port cannot be used.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family)
    except OSError as error:
        reason = str(error.strerror or error).partition(" (while")[0]  # Python repeats the address there
        raise DoorstateError(f"cannot listen on {host}, port {port}: {reason}") from error
    # Connections inherit this. asyncio sets it only for sockets of its own; without it the second part of a response
    # waits 40 ms until the client acknowledges the first.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener
