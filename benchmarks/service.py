# SPDX-License-Identifier: Apache-2.0
"""Throughput, latency and memory of `doorstate serve` on loopback."""

from __future__ import annotations

import http.client
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks.clouds import raw_cloud
from benchmarks.store import Result
from benchmarks.timing import format_ms, tree_resident_mib
from doorstate._jobs import Progress
from doorstate.errors import RunError
from doorstate.evaluation.table import Table
from doorstate.io.pcd import write_pcd

_COMMAND = (sys.executable, "-c", "from doorstate.cli import main; main()", "serve", "--port", "0")
_STOP_S = 60.0


def measure_service(
    clients: Sequence[int], seconds: float, options: Sequence[str], progress: Progress
) -> list[Result]:
    """Return one row per number of clients, all from one process of the service.

    Args:
        clients: numbers of clients; each sends its next file when the previous one is answered.
        seconds: duration for each number of clients, after one file of each as a warm-up.
        options: command-line options of the service.
        progress: called with measured and all numbers of clients.

    Raises:
        RunError: the service did not start, or ended with an error.
    """
    rows = []
    cloud = _cloud_file()
    with _service(options) as (process, port):
        for number, count in enumerate(clients):
            progress(number, len(clients))
            rows.append(_row(process, port, cloud, count, seconds))
    progress(len(clients), len(clients))
    return rows


def service_table(rows: Sequence[Result]) -> Table:
    """Return one row per number of clients."""
    cells = [
        (
            str(row["clients"]),
            f"{row['clouds_per_s']:.1f}",
            format_ms(row["p50_ms"]),
            format_ms(row["p99_ms"]),
            str(sum(row["responses"].values()) - row["responses"].get("200", 0)),
            f"{row['memory_mib'][0]:.0f}",
            f"{row['memory_mib'][1]:.0f}",
        )
        for row in rows
    ]
    columns = ("clients", "clouds/s", "p50 ms", "p99 ms", "errors", "MiB at the start", "MiB at the end")
    size_kb = rows[0]["file_bytes"] / 1000
    return Table(
        "The service under load",
        columns,
        tuple(cells),
        f"Each client sends a compressed PCD file of a simulated 640 × 480 cloud ({size_kb:.0f} kB) over one "
        "connection on loopback, and the next when it is answered; latency is that of successful requests. The clients "
        "run on the same processors.",
    )


def _row(process: subprocess.Popen[str], port: int, cloud: bytes, clients: int, seconds: float) -> Result:
    with ThreadPoolExecutor(clients) as threads:
        list(threads.map(lambda _: _send(port, cloud, 0.0), range(clients)))
        before_mib, started = tree_resident_mib(process.pid), time.perf_counter()
        requests = [
            request
            for client in threads.map(lambda _: _send(port, cloud, seconds), range(clients))
            for request in client
        ]
        elapsed_s = time.perf_counter() - started
    answered_ms = [duration_ms for status, duration_ms in requests if status == "200"]
    p50_ms, p99_ms = np.percentile(answered_ms, (50, 99)) if answered_ms else (np.nan, np.nan)
    return {
        "clients": clients,
        "seconds": elapsed_s,
        "file_bytes": len(cloud),
        "responses": dict(Counter(status for status, _ in requests)),
        "clouds_per_s": len(answered_ms) / elapsed_s,
        "p50_ms": float(p50_ms),
        "p99_ms": float(p99_ms),
        "memory_mib": [before_mib, tree_resident_mib(process.pid)],
    }


def _send(port: int, cloud: bytes, seconds: float) -> list[tuple[str, float]]:
    """Send files for some time, at least one; return status or type of error, and milliseconds, of each request."""
    requests: list[tuple[str, float]] = []
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_STOP_S)
    end = time.perf_counter() + seconds
    while not requests or time.perf_counter() < end:
        started = time.perf_counter()
        try:
            connection.request("POST", "/predict?format=pcd", cloud)
            response = connection.getresponse()
            response.read()
            status = str(response.status)
        except (OSError, http.client.HTTPException) as error:
            connection.close()
            status = type(error).__name__
        requests.append((status, (time.perf_counter() - started) * 1000))
    connection.close()
    return requests


@contextmanager
def _service(options: Sequence[str]) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run the service; yield its process and its port."""
    with subprocess.Popen([*_COMMAND, *options], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            if not line:
                raise RunError("the service did not start; see its output above")
            yield process, int(line.split()[3].rpartition(":")[2])
        finally:
            process.terminate()
            code = process.wait(_STOP_S)
    if code != 0:
        raise RunError(f"the service ended with exit code {code}")


def _cloud_file() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.pcd"
        write_pcd(path, raw_cloud())
        return path.read_bytes()
