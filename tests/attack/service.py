# SPDX-License-Identifier: Apache-2.0
"""Honest clients of the service alone, and beside hostile ones."""

from __future__ import annotations

import gzip
import http.client
import json
import multiprocessing
import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.clouds import raw_cloud
from benchmarks.timing import tree_resident_mib, tree_shared_once_mib

from doorstate.io.pcd import write_pcd

HONEST, HOSTILE = 64, 100
_COMMAND = (sys.executable, "-c", "from doorstate.cli import main; main()", "serve", "--port", "0")
_PAUSE_S = 0.2  # of a hostile client between two connections
_STALLED_BYTES = 64 * 2**20 - 1000


@dataclass
class Counts:
    """Responses to honest clients, and times of `/health`."""

    statuses: Counter[str] = field(default_factory=Counter)
    latencies_s: list[float] = field(default_factory=list)
    health_s: list[float] = field(default_factory=list)
    memory_mib: float = 0.0
    shared_once_mib: float = 0.0


def attack_service(folder: Path, seconds: float) -> dict[str, Any]:
    """Return clouds a second of honest clients alone and under attack, memory and times of `/health`.

    Args:
        folder: for temporary files.
        seconds: duration of each of the two parts.
    """
    path = folder / "cloud.pcd"
    write_pcd(path, raw_cloud())
    cloud = path.read_bytes()
    with _service() as (process, port):
        alone = _measure(process, port, cloud, seconds, hostile=0)
        attacked = _measure(process, port, cloud, seconds, hostile=HOSTILE)
        time.sleep(1)
        after = _measure(process, port, cloud, min(seconds, 10), hostile=0)
    rates = [part.statuses["200"] / length for part, length in ((alone, seconds), (attacked, seconds))]
    return {
        "honest": HONEST,
        "hostile": HOSTILE,
        "seconds": seconds,
        "clouds_per_s_alone": rates[0],
        "clouds_per_s_attacked": rates[1],
        "share": rates[1] / rates[0],
        "clouds_per_s_after": after.statuses["200"] / min(seconds, 10),
        "responses_attacked": dict(attacked.statuses),
        "p99_ms_attacked": float(np.percentile(attacked.latencies_s or [np.nan], 99)) * 1000,
        "health_max_ms": max(attacked.health_s) * 1000,
        "health_p99_ms": float(np.percentile(attacked.health_s, 99)) * 1000,
        "resident_max_mib": max(part.memory_mib for part in (alone, attacked)),
        "memory_max_mib": max(part.shared_once_mib for part in (alone, attacked)),
    }


def _measure(process: subprocess.Popen[str], port: int, cloud: bytes, seconds: float, hostile: int) -> Counts:
    counts, stop = Counts(), threading.Event()
    threads = [
        threading.Thread(target=_honest, args=(port, cloud, number, counts, stop)) for number in range(HONEST)
    ]
    threads.append(threading.Thread(target=_watch, args=(process, port, counts, stop)))
    # In a process of low priority: real ones would have processors of their own.
    enemy = multiprocessing.get_context("spawn").Process(target=_attack, args=(port, hostile, seconds + 5))
    if hostile:
        enemy.start()
        stop.wait(3)
    for thread in threads:
        thread.start()
    stop.wait(seconds)
    stop.set()
    for thread in threads:
        thread.join(40)
    if hostile:
        enemy.kill()
        enemy.join()
    return counts


def _attack(port: int, clients: int, seconds: float) -> None:
    """Attack with a number of clients; runs in a process of its own."""
    os.nice(19)
    stop = threading.Event()
    attacks = [_stall_upload, _hold_heads, _send_heavy_text, _send_gzip_bomb, _send_garbage]
    for number in range(clients):
        threading.Thread(
            target=_repeat, args=(attacks[number % len(attacks)], port, number, stop), daemon=True
        ).start()
    stop.wait(seconds)


def _honest(port: int, cloud: bytes, number: int, counts: Counts, stop: threading.Event) -> None:
    connection = _connection(port, f"127.0.1.{number + 1}")
    while not stop.is_set():
        started = time.perf_counter()
        try:
            connection.request("POST", "/predict?format=pcd", cloud)
            response = connection.getresponse()
            body = response.read()
            status = str(response.status)
            if status == "200":
                assert json.loads(body)["state"] is not None or json.loads(body)["reason"]
                counts.latencies_s.append(time.perf_counter() - started)
        except (OSError, http.client.HTTPException) as error:
            connection.close()
            status = type(error).__name__
        if not stop.is_set():
            counts.statuses[status] += 1
        if status != "200":
            stop.wait(random.Random(number).uniform(0.2, 1.0))
    connection.close()


def _watch(process: subprocess.Popen[str], port: int, counts: Counts, stop: threading.Event) -> None:
    connection = _connection(port, "127.0.0.9")
    while not stop.wait(0.25):
        started = time.perf_counter()
        try:
            connection.request("GET", "/health")
            connection.getresponse().read()
            counts.health_s.append(time.perf_counter() - started)
        except (OSError, http.client.HTTPException):
            connection.close()
            counts.health_s.append(float("inf"))
        counts.memory_mib = max(counts.memory_mib, tree_resident_mib(process.pid))
        counts.shared_once_mib = max(counts.shared_once_mib, tree_shared_once_mib(process.pid))
    connection.close()


def _connection(port: int, address: str) -> http.client.HTTPConnection:
    return http.client.HTTPConnection("127.0.0.1", port, timeout=35, source_address=(address, 0))


Attack = Callable[[socket.socket, threading.Event], None]


def _repeat(attack: Attack, port: int, number: int, stop: threading.Event) -> None:
    """Attack again and again, each time over a new connection."""
    while not stop.wait(_PAUSE_S):
        with (
            suppress(OSError),
            socket.create_connection(
                ("127.0.0.1", port), timeout=35, source_address=(f"127.0.2.{number + 1}", 0)
            ) as connection,
        ):
            attack(connection, stop)


def _stall_upload(connection: socket.socket, stop: threading.Event) -> None:
    """Send all of a large file but its end, and wait."""
    connection.sendall(_head("npy", _STALLED_BYTES + 1000))
    part = bytes(2**20)
    for _ in range(_STALLED_BYTES // len(part)):
        if stop.is_set():
            return
        connection.sendall(part)
    connection.recv(1)


def _hold_heads(connection: socket.socket, stop: threading.Event) -> None:
    """Open ten more connections, and send a part of a head on each."""
    address, server = connection.getsockname()[0], connection.getpeername()
    crowd = [connection]
    try:
        for _ in range(10):
            crowd.append(socket.create_connection(server, timeout=5, source_address=(address, 0)))
        for one in crowd:
            one.sendall(b"POST /predict HTTP/1.1\r\nHost: local")
        stop.wait(8)
    finally:
        for one in crowd[1:]:
            one.close()


_ROWS = b"1.234567,2.345678,0.123456\n"
_TEXT = _ROWS * (64 * 2**20 // len(_ROWS) - 1)
_SMALL_TEXT = _ROWS * (250 * 2**10 // len(_ROWS))
_BOMB = gzip.compress(bytes(63 * 2**20))


def _send_heavy_text(connection: socket.socket, stop: threading.Event) -> None:
    """Send a text that takes long to read, of the largest size or just too small to be a large one."""
    text = _TEXT if stop.wait(0.01) or random.random() < 0.3 else _SMALL_TEXT
    connection.sendall(_head("csv", len(text)))
    connection.sendall(text)
    connection.recv(1)


def _send_gzip_bomb(connection: socket.socket, stop: threading.Event) -> None:
    """Send a small file that is large when unpacked."""
    connection.sendall(_head("csv", len(_BOMB), "Content-Encoding: gzip\r\n") + _BOMB)
    connection.recv(1)


def _send_garbage(connection: socket.socket, stop: threading.Event) -> None:
    """Send what is not HTTP, and files that are none."""
    connection.sendall(
        random.randbytes(1000) if random.random() < 0.5 else _head("pcd", 5000) + random.randbytes(5000)
    )
    connection.recv(1)


def _head(form: str, length: int, more: str = "") -> bytes:
    return f"POST /predict?format={form} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n{more}\r\n".encode()


@contextmanager
def _service() -> Iterator[tuple[subprocess.Popen[str], int]]:
    with subprocess.Popen(_COMMAND, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, int(process.stdout.readline().split()[3].rpartition(":")[2])
        finally:
            process.terminate()
            code = process.wait(60)
    assert code == 0, f"the service ended with exit code {code}"
