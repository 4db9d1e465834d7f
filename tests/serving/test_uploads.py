# SPDX-License-Identifier: Apache-2.0
"""Uploads over real sockets: large, slow, stalled and abandoned ones."""

from __future__ import annotations

import socket
import time

import httpx

from tests.serving.helpers import NPY, error_of, serving


def send_head(client: httpx.Client, head: str, address: str = "127.0.0.1") -> socket.socket:
    """Return a connection from an address of this machine that has sent only the head of a request."""
    server = (client.base_url.host, client.base_url.port or 0)
    connection = socket.create_connection(server, timeout=60, source_address=(address, 0))
    connection.sendall(f"{head}\r\nHost: localhost\r\n\r\n".encode())
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


def test_slow_clients_end_and_do_not_block_others() -> None:
    head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000"
    for limits, status in (({"timeout_s": 0.7}, 504), ({"stall_timeout_s": 0.3}, 408)):
        with serving(queue=0, **limits) as client:
            slow = [send_head(client, head) for _ in range(5)]
            for connection in slow:
                connection.sendall(NPY[:10])
            response = client.post("/predict?format=npy", content=NPY)
            assert response.status_code == 200, "one worker and five slow clients"
            assert [status_of(connection) for connection in slow] == [status] * 5
            for connection in slow:
                connection.close()


def test_upload_that_keeps_moving_is_complete() -> None:
    with serving(stall_timeout_s=1.0) as client:
        head = f"POST /predict?format=npy HTTP/1.1\r\nContent-Length: {len(NPY)}"
        with send_head(client, head) as connection:
            for start in range(0, len(NPY), 1000):
                connection.sendall(NPY[start : start + 1000])
                time.sleep(0.25)
            assert status_of(connection) == 200


def test_disconnected_clients_free_their_places() -> None:
    with serving(queue=0) as client:
        for _ in range(3):
            send_head(client, "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 1000").close()
        assert client.post("/predict?format=npy", content=NPY).status_code == 200


def test_stalled_uploads_give_way_to_others() -> None:
    with serving(max_bytes=10_000, bytes_in_flight=20_000) as client:
        head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 9900"
        stalled = [send_head(client, head, f"127.0.0.{number}") for number in (2, 3)]
        for connection in stalled:  # 19.6 of 20 kB
            connection.sendall(bytes(9800))
        time.sleep(0.7)
        assert client.post("/predict?format=npy", content=NPY).status_code == 200
        assert status_of(stalled[0]) == 408, "idle for the longest time"
        for connection in stalled:
            connection.close()


def test_one_client_gets_half_of_the_bytes() -> None:
    with serving(max_bytes=10_000, bytes_in_flight=20_000) as client:
        head = "POST /predict?format=npy HTTP/1.1\r\nContent-Length: 9000"
        with send_head(client, head, "127.0.0.2") as small, send_head(client, head, "127.0.0.3") as other:
            small.sendall(bytes(10))
            other.sendall(bytes(8000))
            time.sleep(0.2)
            with send_head(client, head, "127.0.0.3") as refused:
                refused.sendall(bytes(8000))
                assert status_of(refused) == 503
