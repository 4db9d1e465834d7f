# SPDX-License-Identifier: Apache-2.0
"""Service with an untrained network in a thread, and clouds to send to it."""

from __future__ import annotations

import io
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx
import numpy as np
import uvicorn

from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.serving.app import create_app
from doorstate.serving.server import KEEP_ALIVE_S
from doorstate.serving.work_queue import Limits

NETWORK = create_network("pointnet")
CARD = WeightsCard(network="pointnet", num_points=256)
CLOUD = np.random.default_rng(0).uniform((1, -1, -1), (3, 1, 1), (500, 3)).astype(np.float32)


def npy_bytes(array: np.ndarray) -> bytes:
    """Return the content of a .npy file."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


NPY = npy_bytes(CLOUD)


@contextmanager
def serving(gate: Any = None, rule: str = "", **limits: Any) -> Iterator[httpx.Client]:
    """Run the service in a thread of this process, and yield a client."""
    predictor = (
        RulePredictor.from_name(rule) if rule else NetworkPredictor(TorchBackend(NETWORK, CARD), gate=gate)
    )
    app = create_app(predictor, Limits(**{"workers": 1} | limits))
    listener = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(
        app,
        http="h11",
        ws="none",
        log_level="error",
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=10,
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=10) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join()


def error_of(response: httpx.Response, status: int) -> str:
    """Return the text of an error response, which must be one line."""
    assert response.status_code == status, response.text
    assert set(response.json()) == {"error"}
    error: str = response.json()["error"]
    assert "\n" not in error
    return error
