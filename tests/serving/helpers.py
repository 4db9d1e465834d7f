# SPDX-License-Identifier: Apache-2.0
"""Service in a thread, with a predictor that tests can control, and clouds to send to it."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray

from doorstate.errors import ConfigError, WeightsError
from doorstate.inference.abstention import Abstention
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.serving.access import Access
from doorstate.serving.app import create_app
from doorstate.serving.limits import Limits
from doorstate.serving.server import create_server, listen
from doorstate.serving.work_queue import WorkQueue
from doorstate.serving.worker import LoadPredictor
from doorstate.types import STATES, DoorState

CLOUD = np.random.default_rng(0).uniform((1, -1, -1), (3, 1, 1), (500, 3)).astype(np.float32)


class MeanPredictor(Predictor):
    """Predictor whose probabilities follow from the mean of the cloud; it does what the first point says.

    Args:
        folder: folder of the files that it waits for.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder

    @property
    def name(self) -> str:
        return "mean"

    def _predict(self, clouds: Sequence[NDArray[np.float32]], known: Known) -> list[Prediction]:
        return [self._answer(cloud) for cloud in clouds]

    def _answer(self, cloud: NDArray[np.float32]) -> Prediction:
        order = float(np.nan_to_num(cloud.reshape(-1, 3)[:1, :1]).sum())
        if order == WAIT and self._folder is not None:
            (self._folder / "arrived").touch()
            while not (self._folder / "go").exists():
                time.sleep(0.01)
        if order == SLEEP:
            time.sleep(60)
        if order == CRASH:
            raise SystemExit(3)
        if order == TAKE_MEMORY:
            np.ones(2**31, np.float64)
        if order == FAULT:
            raise ZeroDivisionError
        if order == BROKEN:
            raise WeightsError("cannot be run", path=Path("door.onnx"))
        if order == INVALID:
            return Prediction.abstain(Abstention("invalid_outputs"), num_points=500)
        points = self.prepare(cloud).points
        p = float(np.clip(np.abs(points).mean() / 10, 0.01, 0.9))
        return Prediction(
            DoorState.CLOSED,
            raw_probabilities=dict(zip(STATES, (1 - p, p, 0.0), strict=True)),
            num_points=len(points),
            milliseconds=1.0,
        )


WAIT, SLEEP, CRASH, TAKE_MEMORY, FAULT, INVALID, BROKEN = 90.0, 91.0, 92.0, 93.0, 94.0, 95.0, 96.0
"""Coordinates of a first point, as orders to `MeanPredictor`."""


def refuse_to_load() -> Predictor:
    """Load nothing."""
    raise ConfigError("no such network", field="network")


def npy_bytes(array: np.ndarray) -> bytes:
    """Return the content of a .npy file."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def order(number: float, points: int = 500) -> bytes:
    """Return a file whose first point is an order."""
    cloud = np.resize(CLOUD, (points, 3)).copy()
    cloud[0] = number
    return npy_bytes(cloud)


NPY = npy_bytes(CLOUD)


@contextmanager
def serving(
    load: LoadPredictor | None = None, access: Access | None = None, folder: Path | None = None, **limits: Any
) -> Iterator[httpx.Client]:
    """Run the service in a thread of this process, and yield a client."""
    chosen = Limits(**{"workers": 1, "memory_bytes": None} | limits)
    queue = WorkQueue(load or partial(MeanPredictor, folder), chosen)
    listener = listen("127.0.0.1", 0)
    server = create_server(create_app(queue, access), chosen)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=30) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join(10)
        queue.close()


def error_of(response: httpx.Response, status: int) -> str:
    """Check the status, and return the one line of the error."""
    assert response.status_code == status, response.text
    body = response.json()
    assert list(body) == ["error"]
    error: str = body["error"]
    assert "\n" not in error
    return error
