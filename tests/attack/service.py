# SPDX-License-Identifier: Apache-2.0
"""Honest clients of the service alone, beside hostile clients, and beside hostile ones that attack a sink instead."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.clouds import raw_cloud
from benchmarks.timing import tree_resident_mib, tree_shared_once_mib

from doorstate.io.pcd import write_pcd

HONEST, HOSTILE = 64, 100
_SERVE = ("-c", "from doorstate.cli import main; main()", "serve", "--port", "0")
_HOSTILE = str(Path(__file__).with_name("hostile.py"))
_SHARED_ADDRESS = "127.0.3.1"
_HEAD_START_S = 3.0  # of hostile clients


@dataclass
class Counts:
    """Responses to honest clients, times of `/health`, and processor time of the hostile clients."""

    seconds: float
    statuses: Counter[str] = field(default_factory=Counter)
    latencies_s: list[float] = field(default_factory=list)
    health_s: list[float] = field(default_factory=list)
    memory_mib: float = 0.0
    shared_once_mib: float = 0.0
    hostile_cpu_s: float = 0.0

    @property
    def rate(self) -> float:
        """Clouds a second."""
        return self.statuses["200"] / self.seconds


def attack_service(folder: Path, seconds: float, one_address: bool = False) -> dict[str, Any]:
    """Return clouds a second of honest clients alone and under attack, memory and times of `/health`.

    The clients run on the processors of the service. How much that alone costs is measured with the same hostile
    clients on a sink, which reads nothing.

    Args:
        folder: for temporary files.
        seconds: duration of each part; the honest clients alone have half before the others, and half after.
        one_address: let all clients have the same address, as behind a router or a proxy.
    """
    path = folder / "cloud.pcd"
    write_pcd(path, raw_cloud())
    cloud = path.read_bytes()
    address = _SHARED_ADDRESS if one_address else ""
    options = ("--client-connections", "512") if one_address else ()
    with _program(*_SERVE, *options) as service, _program(_HOSTILE, "sink") as sink:
        ports = [_port(service), int(_line(sink))]
        honest = _Honest(service.pid, ports[0], cloud, address)
        before = honest.measure(seconds / 2)
        with _program(_HOSTILE, "attack", str(ports[1]), str(HOSTILE), address, ready=True) as hostile:
            beside_sink = honest.measure(seconds, hostile)
        with _program(_HOSTILE, "attack", str(ports[0]), str(HOSTILE), address, ready=True) as hostile:
            attacked = honest.measure(seconds, hostile)
        time.sleep(1)
        after = honest.measure(seconds / 2)
        sink.kill()
    alone = (before.rate + after.rate) / 2
    parts = (before, beside_sink, attacked, after)
    return {
        "honest": HONEST,
        "hostile": HOSTILE,
        "addresses": "one" if one_address else "one a client",
        "seconds": seconds,
        "clouds_per_s_alone": alone,
        "clouds_per_s_alone_before_and_after": [before.rate, after.rate],
        "clouds_per_s_beside_sink": beside_sink.rate,
        "clouds_per_s_attacked": attacked.rate,
        "share_beside_sink": beside_sink.rate / alone,
        "share": attacked.rate / alone,
        "hostile_cpu_s_beside_sink": beside_sink.hostile_cpu_s,
        "hostile_cpu_s": attacked.hostile_cpu_s,
        "responses_alone": dict(before.statuses + after.statuses),
        "responses_attacked": dict(attacked.statuses),
        "p99_ms_alone": _percentile_ms(before.latencies_s + after.latencies_s),
        "p99_ms_attacked": _percentile_ms(attacked.latencies_s),
        "health_max_ms": max(attacked.health_s) * 1000,
        "health_p99_ms": _percentile_ms(attacked.health_s),
        "resident_max_mib": max(part.memory_mib for part in parts),
        "memory_max_mib": max(part.shared_once_mib for part in parts),
    }


def _percentile_ms(seconds: list[float]) -> float:
    return float(np.percentile(seconds or [np.nan], 99)) * 1000


class _Honest:
    """Honest clients, each of which sends the next cloud when the last one is answered.

    Args:
        process: number of the process of the service.
        port: its port.
        cloud: file to send.
        address: address of all clients; by default each has one of its own.
    """

    def __init__(self, process: int, port: int, cloud: bytes, address: str) -> None:
        self._process, self._port, self._cloud, self._address = process, port, cloud, address

    def measure(self, seconds: float, hostile: subprocess.Popen[str] | None = None) -> Counts:
        """Return what the clients got in some seconds."""
        counts, stop = Counts(seconds), threading.Event()
        threads = [
            threading.Thread(target=self._send, args=(number, counts, stop)) for number in range(HONEST)
        ]
        threads.append(threading.Thread(target=self._watch, args=(counts, stop)))
        if hostile is not None:
            time.sleep(_HEAD_START_S)
        for thread in threads:
            thread.start()
        used_s = _cpu_s(hostile)
        stop.wait(seconds)
        stop.set()
        counts.hostile_cpu_s = _cpu_s(hostile) - used_s
        for thread in threads:
            thread.join(40)
        return counts

    def _send(self, number: int, counts: Counts, stop: threading.Event) -> None:
        connection = self._connect(f"127.0.1.{number + 1}")
        while not stop.is_set():
            started = time.perf_counter()
            try:
                connection.request("POST", "/predict?format=pcd", self._cloud)
                response = connection.getresponse()
                body = response.read()
                status = str(response.status)
                if status == "200":
                    answer = json.loads(body)
                    assert answer["state"] is not None or answer["reason"]
                    counts.latencies_s.append(time.perf_counter() - started)
            except (OSError, HTTPException) as error:
                connection.close()
                status = type(error).__name__
            if not stop.is_set():
                counts.statuses[status] += 1
            if status != "200":
                stop.wait(random.Random(number).uniform(0.2, 1.0))
        connection.close()

    def _watch(self, counts: Counts, stop: threading.Event) -> None:
        connection = self._connect("127.0.0.9")
        while not stop.wait(0.25):
            started = time.perf_counter()
            try:
                connection.request("GET", "/health")
                connection.getresponse().read()
                counts.health_s.append(time.perf_counter() - started)
            except (OSError, HTTPException):
                connection.close()
                counts.health_s.append(float("inf"))
            counts.memory_mib = max(counts.memory_mib, tree_resident_mib(self._process))
            counts.shared_once_mib = max(counts.shared_once_mib, tree_shared_once_mib(self._process))
        connection.close()

    def _connect(self, address: str) -> HTTPConnection:
        source = (self._address or address, 0)
        return HTTPConnection("127.0.0.1", self._port, timeout=35, source_address=source)


def _cpu_s(process: subprocess.Popen[str] | None) -> float:
    """Return the processor time of a process (proc(5), stat)."""
    if process is None:
        return 0.0
    fields = Path(f"/proc/{process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def _port(service: subprocess.Popen[str]) -> int:
    return int(_line(service).split()[3].rpartition(":")[2])


@contextmanager
def _program(*arguments: str, ready: bool = False) -> Iterator[subprocess.Popen[str]]:
    """Run a Python program until the block ends; a service must stop with exit code 0."""
    command = (sys.executable, *arguments)
    with ExitStack() as stack:
        process = stack.enter_context(
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        )
        stack.callback(process.kill)
        if ready:
            assert _line(process) == "ready\n"
        yield process
        if arguments[0] != _HOSTILE:
            process.terminate()
            code = process.wait(60)
            assert code == 0, f"the service ended with exit code {code}"
        with suppress(OSError):
            process.kill()
