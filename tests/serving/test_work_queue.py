# SPDX-License-Identifier: Apache-2.0
"""Limits of the service over real sockets: large files, slow clients, full queue."""

from __future__ import annotations

import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor, as_completed

import httpx
import numpy as np

from tests.serving.helpers import CLOUD, NPY, error_of, npy_bytes, serving


class BlockingGate:
    """Gate that admits every cloud, but only after it was opened; a worker waits until then."""

    def __init__(self) -> None:
        self.opened = threading.Event()
        self.arrived = threading.Semaphore(0)

    def __call__(self, cloud: np.ndarray) -> None:
        self.arrived.release()
        assert self.opened.wait(10)


def send_head(client: httpx.Client, head: str) -> socket.socket:
    """Return a connection that has sent only the head of a request."""
    connection = socket.create_connection((client.base_url.host, client.base_url.port or 0), timeout=10)
    connection.sendall(f"{head}\r\nHost: here\r\n\r\n".encode())
    return connection


def status_of(connection: socket.socket) -> int:
    return int(connection.recv(65536).split()[1])


def test_large_file_without_a_declared_length_is_refused(client: httpx.Client) -> None:
    response = client.post("/predict?format=npy", content=iter([bytes(50_000)] * 3))
    assert response.request.headers["transfer-encoding"] == "chunked"
    error_of(response, 413)
    assert client.post("/predict?format=npy", content=iter([NPY[:100], NPY[100:]])).status_code == 200


def test_large_file_is_refused_before_the_upload_ends(client: httpx.Client) -> None:
    head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000000000"
    with send_head(client, head) as connection:
        assert status_of(connection) == 413
    with send_head(client, "POST /predict?format=npy HTTP/1.1\r\nTransfer-Encoding: chunked") as connection:
        for _ in range(3):
            connection.sendall(b"C350\r\n" + bytes(50_000) + b"\r\n")
        assert status_of(connection) == 413
        # The rest is still received, so that no reset hides the response.
        connection.sendall(b"C350\r\n" + bytes(50_000) + b"\r\n")
        started = time.monotonic()
        while connection.recv(65536):
            pass
        assert time.monotonic() - started < 5, "the connection is closed soon"


def test_slow_clients_time_out_and_do_not_block_others() -> None:
    with serving(timeout_s=0.7, queue=0) as client:
        head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000"
        slow = [send_head(client, head) for _ in range(5)]
        for connection in slow:
            connection.sendall(NPY[:10])
        response = client.post("/predict?format=npy", content=NPY)
        assert response.status_code == 200, "one worker and five slow clients"
        assert [status_of(connection) for connection in slow] == [504] * 5
        for connection in slow:
            connection.close()


def test_disconnected_clients_free_their_slots() -> None:
    with serving(queue=0) as client:
        for _ in range(3):
            send_head(client, "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000").close()
        assert client.post("/predict?format=npy", content=NPY).status_code == 200


def test_full_queue_and_slow_worker() -> None:
    gate = BlockingGate()
    with serving(gate, queue=1, timeout_s=1.0) as client, ThreadPoolExecutor(3) as threads:
        running = threads.submit(client.post, "/predict?format=npy", content=NPY)
        assert gate.arrived.acquire(timeout=5)
        later = [threads.submit(client.post, "/predict?format=npy", content=NPY) for _ in range(2)]
        refused = next(as_completed(later)).result()
        error_of(refused, 503)
        assert refused.headers["retry-after"] == "1"
        assert client.get("/health").status_code == 200, "the event loop is free"
        waiting = next(future.result() for future in later if future.result() is not refused)
        for late in (running.result(), waiting):
            error_of(late, 504)
        gate.opened.set()
        deadline = time.monotonic() + 5
        while (response := client.post("/predict?format=npy", content=NPY)).status_code == 503:
            assert time.monotonic() < deadline
        assert response.status_code == 200, "the slots are free again"


def test_bytes_of_unfinished_uploads_are_limited() -> None:
    with serving(max_bytes=10_000, queue=1) as client:
        head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 9000"
        slow = [send_head(client, head) for _ in range(3)]
        for connection in slow:  # 3 x 8 kB exceed two files of 10 kB
            connection.sendall(bytes(8000))
        deadline = time.monotonic() + 5
        while client.post("/predict?format=npy", content=NPY).status_code == 200:
            assert time.monotonic() < deadline
        for connection in slow:
            connection.close()
        while client.post("/predict?format=npy", content=NPY).status_code == 503:
            assert time.monotonic() < deadline + 5


def test_parallel_clients_get_their_own_predictions(client: httpx.Client) -> None:
    files = [npy_bytes(CLOUD * np.float32(scale)) for scale in (1.0, 1.5, 2.0)]

    def predict(file: bytes) -> dict[str, float]:
        probabilities: dict[str, float] = client.post("/predict?format=npy", content=file).json()[
            "probabilities"
        ]
        return probabilities

    expected = [predict(file) for file in files]
    assert len({tuple(probabilities.values()) for probabilities in expected}) == 3
    with ThreadPoolExecutor(6) as threads:
        assert list(threads.map(predict, files * 4)) == expected * 4
