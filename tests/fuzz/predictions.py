# SPDX-License-Identifier: Apache-2.0
"""Targets of everything that predicts: a network, the rules and the gate on impossible clouds, and the service."""

from __future__ import annotations

import asyncio
import json
import math
from functools import cache
from typing import Any
from urllib.parse import quote

import httpx
import numpy as np
from hypothesis import strategies as st

from doorstate.clouds.measured import is_measured
from doorstate.clouds.preparation import MIN_POINTS
from doorstate.inference.gate import DEFAULT_GATE, Gate
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.inference.serialization import prediction_to_dict
from doorstate.io.formats import CLOUD_SUFFIXES
from doorstate.rules import list_rules
from doorstate.serving.access import Access
from doorstate.serving.app import create_app
from doorstate.serving.errors import STATUS_DESCRIPTIONS
from doorstate.serving.limits import Limits
from doorstate.serving.work_queue import WorkQueue
from doorstate.serving.worker import Job, Method, Reply, predict_file
from doorstate.types import STATES, Points
from tests.fuzz.examples import CLOUDS, files, saved
from tests.fuzz.harness import Target, check_line, fuzz_target, outcome_of
from tests.fuzz.strategies import damaged
from tests.hand_made_clouds import image_of_a_rough_wall

_WALL = image_of_a_rough_wall(60, 80)
_GOOD = saved(lambda stream: np.save(stream, _WALL))
_MAX_BYTES = 2**16
_NUMBERS = (0.0, np.nan, np.inf, -np.inf, -1.0, 1e-45, 1e-30, 1e-6, 2.0, 1e3, 1e6, 1e30, 3.4e38)
_DTYPES = ("<f4", "<f4", "<f4", ">f4", "<f2", "<f8", "<i4", "u1")
_QUERIES = (
    b"format=npy&axes=optical&roll=90",
    b"filename=a.png&fx=14&fy=14&cx=7.5&cy=5.5&depth_scale=0.001",
    b"format=csv&units=mm",
)
_HEADERS = {
    b"content-type": (b"image/png", b"text/csv; charset=utf-8", b"application/x-npy"),
    b"content-length": (b"0", b"100", b"99999999"),
    b"transfer-encoding": (b"chunked",),
    b"accept": (b"*/*",),
    b"host": (b"localhost:8000",),
}


@st.composite
def clouds(draw: st.DrawFn) -> Points:
    """Organized and flat clouds with up to four ranges of impossible, equal or collinear points."""
    cloud = draw(st.sampled_from((_WALL, _WALL, _WALL.reshape(-1, 3), *CLOUDS))).copy()
    flat, places = cloud.reshape(-1, 3), st.integers(0, cloud.size // 3)
    with np.errstate(all="ignore"):
        for kind in draw(st.lists(st.sampled_from(["set", "scale", "repeat", "line"]), max_size=4)):
            start, end = sorted((draw(places), draw(places)))
            part, number = flat[start:end], draw(st.sampled_from(_NUMBERS))
            axes = slice(draw(st.sampled_from([0, 1, 2])), draw(st.sampled_from([1, 2, 3])))
            match kind:
                case "set":
                    part[:, axes] = number
                case "scale":
                    part[:, axes] *= np.float32(number)
                case "repeat":
                    part[:] = part[:1].copy()
                case "line":
                    part[:] = np.linspace(-1, 1, len(part))[:, None] * part[:1].copy()
        cloud = cloud.astype(draw(st.sampled_from(_DTYPES)))
    cloud = cloud[: draw(st.integers(0, len(cloud)) | st.just(len(cloud)))]
    return draw(st.sampled_from([cloud, cloud, cloud.swapaxes(0, 1), cloud[None], cloud[..., ::-1]]))


@cache
def _network(gate: Gate | None) -> NetworkPredictor:
    return NetworkPredictor.from_weights("ogurob-pointnet", num_points=MIN_POINTS, gate=gate)


def _predict(predictor: Predictor, cloud: Points, min_points: int) -> str:
    prediction = predictor(cloud)
    json.dumps(prediction_to_dict(prediction), allow_nan=False)
    if prediction.state is None:
        assert prediction.abstention is not None
        check_line(prediction.reason)
        assert (prediction.probabilities, prediction.opening_angle_deg, prediction.frame) == (
            None,
            None,
            None,
        )
        return prediction.abstention.code
    if isinstance(predictor, RulePredictor):
        assert prediction.probabilities is None
    else:
        assert prediction.probabilities is not None
        assert math.isclose(sum(prediction.probabilities.values()), 1, abs_tol=1e-5)
        assert min(prediction.probabilities.values()) >= 0
    measured = cloud[is_measured(np.asarray(cloud, np.float32))]
    assert len(np.unique(measured, axis=0)) >= min_points
    return "predicted"


def predict_with_network(cloud: Points, gate: Gate | None) -> str:
    return outcome_of(lambda: _predict(_network(gate), cloud, MIN_POINTS))


def predict_with_rule(cloud: Points, gate: Gate | None, rule: str) -> str:
    predictor = RulePredictor.from_name(rule, gate=gate)
    return outcome_of(lambda: _predict(predictor, cloud, 1 if gate is None else gate.min_points))


class _LocalQueue(WorkQueue):
    """Queue that reads and predicts in this process, so that faults are found here."""

    def __init__(self) -> None:
        self.limits = Limits(max_bytes=_MAX_BYTES, workers=1)

    problem = ""
    waiting = 0
    is_busy = False

    async def wait_for_space(self, client: str, size: int, suffix: str | None) -> None:
        """There is always space."""

    def note_failed_upload(self, client: str, size: int) -> None:
        """Take no credit."""

    def wait_until_ready(self) -> Method:
        return Method("pointnet", network="pointnet")

    async def run(self, job: Job, client: str) -> Reply:
        return predict_file(_network(DEFAULT_GATE), job, self.limits.max_bytes)


@cache
def _app() -> Any:
    return create_app(_LocalQueue(), Access(("test",)))


async def _post(content: bytes, query: str, headers: list[tuple[bytes, bytes]]) -> httpx.Response:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(_app()), base_url="http://test") as client:
        return await client.post(f"/predict?{query}", content=content, headers=headers)


def request_prediction(
    file: tuple[str, bytes], query: bytes | None, headers: list[tuple[bytes, bytes]]
) -> None:
    """Post a damaged request, whose response must be documented, and then a good one."""
    suffix, content = file
    text = f"format={suffix}" if query is None else quote(query, safe="=&%+")
    response = asyncio.run(_post(content, text, headers))
    body = response.json()
    if response.status_code == 200:
        assert (body["state"] in STATES) != bool(body.get("reason"))
    else:
        assert response.status_code in STATUS_DESCRIPTIONS
        assert set(body) == {"error"}
        check_line(body["error"])
    assert asyncio.run(_post(_GOOD, "format=npy", [])).status_code == 200


def targets() -> dict[str, Target]:
    """Return the targets by name."""
    gate = st.sampled_from([None, DEFAULT_GATE])
    file = st.sampled_from(CLOUD_SUFFIXES).flatmap(
        lambda suffix: st.tuples(st.just(suffix), damaged(files(suffix)))
    )
    header = st.sampled_from(list(_HEADERS)).flatmap(
        lambda name: st.tuples(st.just(name), damaged(_HEADERS[name]))
    )
    query, headers = st.none() | damaged(_QUERIES), st.lists(header, max_size=2)
    return {
        "network": fuzz_target(predict_with_network, cloud=clouds(), gate=gate),
        "rule": fuzz_target(predict_with_rule, cloud=clouds(), gate=gate, rule=st.sampled_from(list_rules())),
        "service": fuzz_target(request_prediction, file=file, query=query, headers=headers),
    }
