# SPDX-License-Identifier: Apache-2.0
"""How many clouds a second `doorstate serve` answers on loopback, how soon, and whether its memory grows."""

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
from benchmarks.store import Group
from benchmarks.tables import milliseconds
from benchmarks.timing import resident_mib
from doorstate._jobs import Progress
from doorstate.errors import RunError
from doorstate.evaluation.table import Table
from doorstate.io.pcd import write_pcd

_COMMAND = (sys.executable, "-c", "from doorstate.cli import main; main()", "serve", "--port", "0")
_STOP_S = 60.0


def measure(
    clients: Sequence[int], seconds: float, options: Sequence[str], progress: Progress
) -> list[Group]:
    """One row for every number of clients, all from one service.

    Args:
        clients: each sends its next file when the last is answered.
        seconds: of every number of clients, after one file each that does not count.
        options: of the service.

    Raises:
        RunError: the service did not start, or did not stop as it should.
    """
    rows = []
    cloud = _cloud_file()
    with _service(options) as (process, port):
        for done, count in enumerate(clients):
            progress(done, len(clients))
            rows.append(_row(process, port, cloud, count, seconds))
    progress(len(clients), len(clients))
    return rows


def service_table(rows: Sequence[Group]) -> Table:
    """One line for every number of clients."""
    cells = [
        (
            str(row["clients"]),
            f"{row['clouds_per_s']:.1f}",
            milliseconds(row["p50_ms"]),
            milliseconds(row["p99_ms"]),
            str(sum(row["answers"].values()) - row["answers"].get("200", 0)),
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
        f"Each client sends a compressed PCD file of a simulated 640 × 480 cloud ({size_kb:.0f} kB) over a kept "
        "connection on loopback, the next when the last is answered; latency is that of answered files, and clients "
        "run on the same processors.",
    )


def _row(process: subprocess.Popen[str], port: int, cloud: bytes, clients: int, seconds: float) -> Group:
    with ThreadPoolExecutor(clients) as threads:
        list(threads.map(lambda _: _send(port, cloud, 0.0), range(clients)))
        before_mib, started = resident_mib(process.pid), time.perf_counter()
        sent = [
            each
            for client in threads.map(lambda _: _send(port, cloud, seconds), range(clients))
            for each in client
        ]
        elapsed_s = time.perf_counter() - started
    answered_ms = [spent_ms for answer, spent_ms in sent if answer == "200"]
    p50_ms, p99_ms = np.percentile(answered_ms, (50, 99)) if answered_ms else (np.nan, np.nan)
    return {
        "clients": clients,
        "seconds": elapsed_s,
        "file_bytes": len(cloud),
        "answers": dict(Counter(answer for answer, _ in sent)),
        "clouds_per_s": len(answered_ms) / elapsed_s,
        "p50_ms": float(p50_ms),
        "p99_ms": float(p99_ms),
        "memory_mib": [before_mib, resident_mib(process.pid)],
    }


def _send(port: int, cloud: bytes, seconds: float) -> list[tuple[str, float]]:
    """Status, or the kind of error, and milliseconds of every file that was sent in this time: one at least."""
    sent: list[tuple[str, float]] = []
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_STOP_S)
    until = time.perf_counter() + seconds
    while not sent or time.perf_counter() < until:
        started = time.perf_counter()
        try:
            connection.request("POST", "/predict?format=pcd", cloud)
            response = connection.getresponse()
            response.read()
            answer = str(response.status)
        except (OSError, http.client.HTTPException) as error:
            connection.close()
            answer = type(error).__name__
        sent.append((answer, (time.perf_counter() - started) * 1000))
    connection.close()
    return sent


@contextmanager
def _service(options: Sequence[str]) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The command in a process of its own, and its port."""
    with subprocess.Popen([*_COMMAND, *options], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            if not line:
                raise RunError("the service did not start; its own words are above")
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
