# SPDX-License-Identifier: Apache-2.0
"""Workers and their queue over real sockets: a full queue, and files that hang, crash or fill a worker."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import httpx
import numpy as np
import pytest

from doorstate.errors import ConfigError
from doorstate.serving.limits import Limits
from doorstate.serving.work_queue import WorkQueue
from tests.serving.helpers import (
    BROKEN,
    CLOUD,
    CRASH,
    FAULT,
    INVALID,
    NPY,
    SLEEP,
    TAKE_MEMORY,
    WAIT,
    error_of,
    npy_bytes,
    order,
    refuse_to_load,
    serving,
)


def wait_for(path: Path) -> None:
    deadline = time.monotonic() + 60
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_full_queue_and_slow_worker(tmp_path: Path) -> None:
    limits = {"queue": 1, "timeout_s": 1.0, "unread_timeout_s": 0.3}
    with serving(folder=tmp_path, **limits) as client, ThreadPoolExecutor(3) as threads:
        running = threads.submit(client.post, "/predict?format=npy", content=order(WAIT))
        wait_for(tmp_path / "arrived")
        later = [threads.submit(client.post, "/predict?format=npy", content=NPY) for _ in range(2)]
        refused = next(as_completed(later)).result()
        error_of(refused, 503)
        assert refused.headers["retry-after"] == "1"
        assert client.get("/health").status_code == 200, "the event loop is free"
        waiting = next(future.result() for future in later if future.result() is not refused)
        for late in (running.result(), waiting):
            error_of(late, 504)
        (tmp_path / "go").touch()
        deadline = time.monotonic() + 60
        while (response := client.post("/predict?format=npy", content=NPY)).status_code == 503:
            assert time.monotonic() < deadline
        assert response.status_code == 200, "the places are free again"


def test_worker_that_takes_too_long_or_ends_is_replaced() -> None:
    with serving(quick_timeout_s=1.0, work_timeout_s=1.5) as client:
        error_of(client.post("/predict?format=npy", content=order(SLEEP)), 504)
        assert client.post("/predict?format=npy", content=NPY).status_code == 200
        error_of(client.post("/predict?format=npy", content=order(CRASH)), 500)
        assert client.post("/predict?format=npy", content=NPY).status_code == 200
        assert "ZeroDivisionError" in error_of(client.post("/predict?format=npy", content=order(FAULT)), 500)
        assert client.get("/health").json()["ready"]


@pytest.mark.parametrize("points", [500, 5000])
@pytest.mark.parametrize(("number", "status"), [(INVALID, 200), (BROKEN, 500)])
def test_broken_network_is_unhealthy(points: int, number: float, status: int) -> None:
    with serving(large_bytes=10_000) as client:
        response = client.post("/predict?format=npy", content=order(number, points))
        assert response.status_code == status
        assert response.json().get("state") is None
        health = client.get("/health")
        assert health.status_code == 503
        assert not health.json()["ready"]
        assert client.post("/predict?format=npy", content=NPY).status_code == 200
        assert client.get("/health").json()["ready"]


def test_memory_of_a_worker_is_limited() -> None:
    with serving(memory_bytes=256 * 2**20) as client:
        error_of(client.post("/predict?format=npy", content=order(TAKE_MEMORY)), 413)
        assert client.post("/predict?format=npy", content=NPY).status_code == 200


def test_large_files_leave_the_workers_to_small_ones(tmp_path: Path) -> None:
    large = order(WAIT, points=5000)
    limits = {"large_bytes": 10_000, "queue": 8, "unread_timeout_s": 0.3}
    with serving(folder=tmp_path, **limits) as client, ThreadPoolExecutor(2) as threads:
        waiting = [threads.submit(client.post, "/predict?format=npy", content=large) for _ in range(2)]
        wait_for(tmp_path / "arrived")
        for _ in range(3):
            assert client.post("/predict?format=npy", content=NPY).status_code == 200
        assert not any(future.done() for future in waiting)
        error_of(client.post("/predict?format=npy", content=large), 503)
        (tmp_path / "go").touch()
        assert [future.result().status_code for future in waiting] == [200, 200]


def test_requests_wait_unread_for_a_place(tmp_path: Path) -> None:
    with serving(folder=tmp_path, queue=0) as client, ThreadPoolExecutor(6) as threads:
        running = threads.submit(client.post, "/predict?format=npy", content=order(WAIT))
        wait_for(tmp_path / "arrived")
        waiting = [threads.submit(client.post, "/predict?format=npy", content=NPY) for _ in range(5)]
        time.sleep(0.3)
        assert not any(future.done() for future in waiting)
        assert "doorstate_files 1.0" in client.get("/metrics").text, "the others are not received"
        (tmp_path / "go").touch()
        assert [future.result().status_code for future in (running, *waiting)] == [200] * 6


def test_client_of_failed_files_leaves_the_workers_to_others(tmp_path: Path) -> None:
    limits = {"failure_s": 0.1, "failure_share": 0.01, "queue": 8, "unread_timeout_s": 0.3}
    with serving(folder=tmp_path, **limits) as client, ThreadPoolExecutor(2) as threads:
        transport = httpx.HTTPTransport(local_address="127.0.0.2")
        with httpx.Client(base_url=client.base_url, transport=transport, timeout=30) as other:
            for _ in range(8):
                error_of(other.post("/predict?format=pcd", content=b"nonsense"), 400)
            assert other.post("/predict?format=npy", content=NPY).status_code == 200, "by the other worker"
            for _ in range(8):
                error_of(other.post("/predict?format=pcd", content=b"nonsense"), 400)
            files = [threads.submit(other.post, "/predict?format=npy", content=order(WAIT)) for _ in range(2)]
            wait_for(tmp_path / "arrived")
            for _ in range(3):
                assert client.post("/predict?format=npy", content=NPY).status_code == 200
            refused = other.post("/predict?format=npy", content=NPY)
            error_of(refused, 429)
            assert 0 < int(refused.headers["retry-after"]) <= 30
            (tmp_path / "go").touch()
            assert [future.result().status_code for future in files] == [200, 200]


def test_successes_keep_the_credit_of_a_client() -> None:
    with serving(failure_s=0.1, failure_share=1e-6) as client:
        processes = len(multiprocessing.active_children())
        for _ in range(12):
            error_of(client.post("/predict?format=pcd", content=b"nonsense"), 400)
            assert client.post("/predict?format=npy", content=NPY).status_code == 200
        assert len(multiprocessing.active_children()) == processes, "the other worker is not needed"


def test_stalled_uploads_take_credit_and_large_files_wait_for_it(tmp_path: Path) -> None:
    limits = {"failure_s": 0.01, "failure_share": 0.001, "stall_timeout_s": 0.2, "unread_timeout_s": 0.3}
    with serving(folder=tmp_path, large_bytes=10_000, **limits) as client, ThreadPoolExecutor(1) as threads:
        large = order(1.0, points=5000)
        transport = httpx.HTTPTransport(local_address="127.0.0.2")
        with httpx.Client(base_url=client.base_url, transport=transport, timeout=30) as other:
            assert other.post("/predict?format=npy", content=large).status_code == 200
            stalled = other.post("/predict?format=npy", content=_stall(NPY))
            error_of(stalled, 408)
            assert other.post("/predict?format=npy", content=large).status_code == 200, "nobody else is there"
            running = threads.submit(client.post, "/predict?format=npy", content=order(WAIT))
            wait_for(tmp_path / "arrived")
            error_of(other.post("/predict?format=npy", content=large), 429)
            assert client.post("/predict?format=npy", content=large).status_code == 200
            (tmp_path / "go").touch()
            assert running.result().status_code == 200


def test_large_files_are_received_slowly_beside_small_ones(tmp_path: Path) -> None:
    large = order(1.0, points=5000)  # 60 kB
    limits = {"large_bytes": 10_000, "large_bytes_per_s": 100_000.0}
    with serving(folder=tmp_path, **limits) as client, ThreadPoolExecutor(1) as threads:
        running = threads.submit(client.post, "/predict?format=npy", content=order(WAIT))
        wait_for(tmp_path / "arrived")
        started = time.monotonic()
        assert client.post("/predict?format=npy", content=large).status_code == 200
        assert time.monotonic() - started > 0.5
        (tmp_path / "go").touch()
        assert running.result().status_code == 200


def _stall(content: bytes) -> Iterator[bytes]:
    yield content[:100]
    time.sleep(0.6)


def test_parallel_clients_get_their_own_predictions(client: httpx.Client) -> None:
    files = [npy_bytes(CLOUD * np.float32(scale)) for scale in (1.0, 1.5, 2.0)]

    def predict(file: bytes) -> dict[str, float]:
        response = client.post("/predict?format=npy", content=file).json()
        probabilities: dict[str, float] = response["probabilities"]
        return probabilities

    expected = [predict(file) for file in files]
    assert len({tuple(probabilities.values()) for probabilities in expected}) == 3
    with ThreadPoolExecutor(6) as threads:
        assert list(threads.map(predict, files * 4)) == expected * 4


def test_predictor_that_cannot_be_loaded_is_reported() -> None:
    queue = WorkQueue(refuse_to_load, Limits(workers=1))
    with pytest.raises(ConfigError) as caught:
        queue.wait_until_ready()
    assert caught.value.field == "network"
    queue.close()
