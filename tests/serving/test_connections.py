# SPDX-License-Identifier: Apache-2.0
"""Connections that do not send a request, and too many of them."""

from __future__ import annotations

import socket
import time
from contextlib import suppress

import httpx
import pytest

from tests.serving.helpers import NPY, serving

WAIT_S = 30.0  # for a busy machine


def connect(client: httpx.Client, address: str = "127.0.0.1") -> socket.socket:
    server = (client.base_url.host, client.base_url.port or 0)
    return socket.create_connection(server, timeout=WAIT_S, source_address=(address, 0))


def is_closed(connection: socket.socket) -> bool:
    """Wait until a connection is closed; false after half a minute."""
    try:
        while connection.recv(65536):
            pass
        return True
    except ConnectionError:
        return True
    except TimeoutError:
        return False


def is_served(client: httpx.Client, address: str) -> bool:
    with connect(client, address) as connection, suppress(ConnectionError):
        connection.sendall(b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
        return connection.recv(65536).startswith(b"HTTP/1.1 200")
    return False


@pytest.mark.parametrize("head", [b"", b"GET /health HTTP/1.1\r\nHost: loc"])
def test_head_has_a_deadline(head: bytes) -> None:
    with serving(head_timeout_s=0.3) as client, connect(client) as connection:
        connection.sendall(head)
        started = time.monotonic()
        assert is_closed(connection)
        assert 0.2 < time.monotonic() - started < 3


def test_next_head_has_a_deadline_too() -> None:
    with serving(head_timeout_s=1.0) as client, connect(client) as connection:
        connection.sendall(b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert connection.recv(65536).startswith(b"HTTP/1.1 200")
        time.sleep(1.2)
        connection.sendall(b"GET /health HTTP/1.1\r\n")
        assert is_closed(connection)


def test_one_address_has_a_number_of_connections() -> None:
    with serving(client_connections=3) as client:
        crowd = [connect(client, "127.0.0.2") for _ in range(4)]
        assert is_closed(crowd[3])
        assert client.get("/health").status_code == 200
        for connection in crowd:
            connection.close()
        deadline = time.monotonic() + WAIT_S
        while not is_served(client, "127.0.0.2"):
            assert time.monotonic() < deadline
            time.sleep(0.05)


def test_connections_without_a_request_give_way_to_others() -> None:
    with serving(connections=4) as client:
        idle = [connect(client, "127.0.0.2") for _ in range(6)]
        assert client.post("/predict?format=npy", content=NPY).status_code == 200
        assert is_closed(idle[0])
        for connection in idle:
            connection.close()


def test_head_has_a_size() -> None:
    with serving() as client, connect(client) as connection, suppress(ConnectionError):
        connection.sendall(b"GET /health HTTP/1.1\r\nX-Long: " + b"a" * 1_000_000)
        assert connection.recv(65536).startswith(b"HTTP/1.1 400")
        assert is_closed(connection)
