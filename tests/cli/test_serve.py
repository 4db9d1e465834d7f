# SPDX-License-Identifier: Apache-2.0
"""`doorstate serve`."""

from __future__ import annotations

import http.client
import json
import os
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


def test_used_port_is_one_line(run: Run, weights: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as used:
        port = used.getsockname()[1]
        check_error(run("serve", "--port", port, "--weights", weights), 1, str(port))
