# SPDX-License-Identifier: Apache-2.0
"""Hostile clients of the service, and a sink for their connections: `python hostile.py attack PORT CLIENTS`.

A program of its own without packages: its start would take seconds of processor time from what is measured.
"""

from __future__ import annotations

import gzip
import os
import random
import selectors
import socket
import sys
import threading
import time
from contextlib import suppress

_PAUSE_S = 0.2  # of a hostile client between two connections
_HOLD_S = 3.0  # of a connection by the sink: as long as the service waits for the next part of an upload
_STALLED_BYTES = 64 * 2**20 - 1000
_ROWS = b"1.234567,2.345678,0.123456\n"
_TEXT = _ROWS * (64 * 2**20 // len(_ROWS) - 1)
_SMALL_TEXT = _ROWS * (250 * 2**10 // len(_ROWS))


def stall_upload(connection: socket.socket) -> None:
    """Send all of a large file but its end, and wait."""
    connection.sendall(_head("npy", _STALLED_BYTES + 1000))
    part = bytes(2**20)
    for _ in range(_STALLED_BYTES // len(part)):
        connection.sendall(part)
    connection.recv(1)


def hold_heads(connection: socket.socket) -> None:
    """Open ten more connections, and send a part of a head on each."""
    address, server = connection.getsockname()[0], connection.getpeername()
    crowd = [connection]
    try:
        for _ in range(10):
            crowd.append(socket.create_connection(server, timeout=5, source_address=(address, 0)))
        for one in crowd:
            one.sendall(b"POST /predict HTTP/1.1\r\nHost: local")
        time.sleep(8)
    finally:
        for one in crowd[1:]:
            one.close()


def send_heavy_text(connection: socket.socket) -> None:
    """Send a text that takes long to read, of the largest size or just too small to be a large one."""
    text = _TEXT if random.random() < 0.3 else _SMALL_TEXT
    connection.sendall(_head("csv", len(text)))
    connection.sendall(text)
    connection.recv(1)


def send_gzip_bomb(connection: socket.socket) -> None:
    """Send a small file that is large when unpacked."""
    connection.sendall(_head("csv", len(_BOMB), "Content-Encoding: gzip\r\n") + _BOMB)
    connection.recv(1)


def send_garbage(connection: socket.socket) -> None:
    """Send what is not HTTP, and files that are none."""
    connection.sendall(
        random.randbytes(1000) if random.random() < 0.5 else _head("pcd", 5000) + random.randbytes(5000)
    )
    connection.recv(1)


_ATTACKS = (stall_upload, hold_heads, send_heavy_text, send_gzip_bomb, send_garbage)


def _head(form: str, length: int, more: str = "") -> bytes:
    return f"POST /predict?format={form} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n{more}\r\n".encode()


def attack(port: int, clients: int, address: str = "") -> None:
    """Attack until the process is killed.

    Args:
        port: port of the service on this machine.
        clients: number of clients.
        address: address of all clients; by default each has one of its own.
    """
    for number in range(clients):
        source = address or f"127.0.2.{number + 1}"
        threading.Thread(target=_repeat, args=(number, port, source), daemon=True).start()
    threading.Event().wait()


def _repeat(number: int, port: int, address: str) -> None:
    """Attack again and again, each time over a new connection."""
    while True:
        time.sleep(_PAUSE_S)
        with (
            suppress(OSError),
            socket.create_connection(
                ("127.0.0.1", port), timeout=35, source_address=(address, 0)
            ) as connection,
        ):
            _ATTACKS[number % len(_ATTACKS)](connection)


def sink() -> None:
    """Accept connections, read nothing, and close each after some seconds: the cost of hostile clients alone."""
    waiter = selectors.DefaultSelector()
    held: list[tuple[float, socket.socket]] = []
    with socket.create_server(("127.0.0.1", 0), backlog=1024) as listener:
        print(listener.getsockname()[1], flush=True)
        waiter.register(listener, selectors.EVENT_READ)
        while True:
            for _ in waiter.select(0.1):
                held.append((time.monotonic() + _HOLD_S, listener.accept()[0]))
            while held and held[0][0] < time.monotonic():
                held.pop(0)[1].close()


if __name__ == "__main__":
    if sys.argv[1] == "sink":
        sink()
    os.nice(19)  # real ones would have processors of their own
    _BOMB = gzip.compress(bytes(63 * 2**20))
    print("ready", flush=True)
    attack(int(sys.argv[2]), int(sys.argv[3]), *sys.argv[4:])
