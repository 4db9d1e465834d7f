# SPDX-License-Identifier: Apache-2.0
"""`doorstate serve`."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import numpy as np
import pytest

pytest.importorskip("uvicorn")

from tests.cli.helpers import Run, check_error
from tests.serving.helpers import npy_bytes

COMMAND = Path(sys.executable).with_name("doorstate")


def test_service_starts_predicts_and_stops(weights: Path, cloud: np.ndarray) -> None:
    process = subprocess.Popen(
        [COMMAND, "serve", "--port", "0", "--weights", weights, "--workers", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().split()[3]
        assert address.startswith("http://127.0.0.1:")
        assert httpx.get(f"{address}/health", timeout=60).json()["ready"] is True
        predicted = httpx.post(f"{address}/predict?format=npy", content=npy_bytes(cloud), timeout=60)
        assert predicted.status_code == 200
        # An idle connection is kept longer than httpx would use it again (5 s), which is Uvicorn's default.
        kept = http.client.HTTPConnection(address.removeprefix("http://"), timeout=60)
        for idle_s in (0.0, 5.5):
            time.sleep(idle_s)
            kept.request("GET", "/health")
            assert json.load(kept.getresponse())["ready"] is True
        kept.close()
    finally:
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (0, "")
    assert all(line.startswith("Loading") for line in err.splitlines())


def test_stalled_upload_does_not_hold_the_end_of_an_open_service() -> None:
    process = subprocess.Popen(
        [
            COMMAND,
            *("serve", "--host", "0", "--port", "0", "--rule", "plane_state", "--workers", "1"),
            *("--timeout-s", "2", "--verbose"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    port = int(process.stdout.readline().split()[3].rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=60) as stalled:
        stalled.sendall(
            b"POST /predict?format=npy HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\nab"
        )
        time.sleep(0.3)
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in err
    warning, *lines = [line for line in err.splitlines() if not line.startswith("Loading")]
    assert "--token" in warning
    assert lines
    assert all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3} [A-Z]+ ", line) for line in lines)


def test_empty_token_is_one_line(run: Run, weights: Path) -> None:
    check_error(run("serve", "--port", 0, "--weights", weights, "--token", ""), 2, "--token")


def test_used_port_is_one_line(run: Run, weights: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as used:
        port = used.getsockname()[1]
        check_error(run("serve", "--port", port, "--weights", weights), 1, str(port))
