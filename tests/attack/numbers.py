# SPDX-License-Identifier: Apache-2.0
"""Broken numbers in weights, cards, graphs and streams never become an answer."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from onnx import TensorProto, helper, numpy_helper
from safetensors.torch import save_file

from doorstate.clouds.preparation import MIN_POINTS
from doorstate.inference.abstention import AbstentionCode
from doorstate.inference.backends.onnx_backend import (
    INPUT,
    PROBABILITIES,
    RAW_PROBABILITIES,
    REASON,
    REASONS,
)
from doorstate.inference.export.description import describe
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction
from doorstate.inference.state_filter import StateFilter
from doorstate.inference.waiting import wait_for
from doorstate.networks import create_network
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.digest import add_digest
from doorstate.networks.weights import save_weights
from doorstate.types import DOOR, STATES, DoorState
from tests.attack.tries import Try, Violation, attempt

CARD = WeightsCard(network="pointnet", num_points=MIN_POINTS)
BROKEN = (math.nan, math.inf, -math.inf)
ROWS = (
    [-5, 3, 3],
    [3, 3, 3],
    [1e9, 0, 0],
    [-1, 1, 1],
    [0, 0, 0],
    [0.5, 0.5, 0.5],
    *([x, 0.5, 0.5] for x in BROKEN),
)
_CLOUD = np.random.default_rng(0).normal(2.0, 0.5, (MIN_POINTS * 2, 3)).astype(np.float32)


def attack_weights(folder: Path, rounds: int) -> Iterator[Try]:
    """Break one number, type, shape, byte or setting of a weights file."""
    network, path = create_network("pointnet"), folder / "w.safetensors"
    good = network.state_dict()
    floats = [name for name, tensor in good.items() if tensor.is_floating_point()]
    for name in floats[:: max(1, len(floats) // rounds)]:
        for number in BROKEN:
            tensor = good[name].clone()
            tensor.view(-1)[-1] = number
            yield _try_weights("a number of a weights file is NaN or infinite", path, good | {name: tensor})
        for kind in (torch.int32, torch.uint8, torch.bfloat16, torch.bool):
            yield _try_weights("a tensor of another type", path, good | {name: good[name].to(kind)})
        for tensor in (good[name].reshape(-1)[:-1], good[name][None], torch.zeros(0)):
            yield _try_weights("a tensor of another shape", path, good | {name: tensor})
    for values in (
        *({"temperature": x} for x in (1e-300, 0, -1, 1e300, "NaN")),
        {"abstain_below": 2},
        {"scale_m": -1},
    ):
        yield _try_weights("impossible settings in a card", path, good, values)
    save_weights(path, network, CARD)
    yield from _flip_bytes("a flipped bit of a weights file", path, rounds)


def attack_graphs(folder: Path, rounds: int) -> Iterator[Try]:
    """Export graphs whose outputs are no probabilities, and flip their bits."""
    path = folder / "w.onnx"
    for row in ROWS:
        write_graph(path, row)
        yield attempt("an exported network gives no probabilities", lambda: _answer(path), Violation.NUMBERS)
    for number, reason in product((*BROKEN, 7.0), REASONS):
        write_graph(path, [0.1, 0.1, 0.8], number, reason)
        yield attempt("an exported network gives a broken head", lambda: _answer(path), Violation.NUMBERS)
    write_graph(path, [0.2, 0.3, 0.5])
    yield from _flip_bytes("a flipped bit of an exported network", path, rounds)


def attack_streams(folder: Path, rounds: int) -> Iterator[Try]:
    """Put broken predictions into a filter, and wait for a door."""
    for row in ROWS:
        broken = _prediction(DoorState.OPEN, dict(zip(STATES, row, strict=True)))
        yield attempt("a broken prediction in StateFilter", partial(_filter, broken), Violation.NUMBERS)
        yield attempt("broken predictions in wait_for", partial(_wait, broken), Violation.NUMBERS)


def _try_weights(
    kind: str, path: Path, tensors: Mapping[str, torch.Tensor], card: Mapping[str, Any] | None = None
) -> Try:
    text = json.dumps(CARD.model_dump(mode="json") | dict(card or {}))
    save_file(dict(tensors), path, {CARD_KEY: text})
    return attempt(kind, lambda: _answer(path), Violation.NUMBERS)


def _flip_bytes(kind: str, path: Path, rounds: int) -> Iterator[Try]:
    content = path.read_bytes()
    for place in np.linspace(0, len(content) - 1, 10 * rounds, dtype=int):
        changed = bytearray(content)
        changed[place] ^= 1 << int(place) % 8
        path.write_bytes(changed)
        yield attempt(kind, lambda: _answer(path), Violation.NUMBERS)


def _answer(path: Path) -> str:
    """Return the outcome of weights or a graph that must not answer."""
    prediction = NetworkPredictor.from_weights(path, num_points=MIN_POINTS, gate=None)(_CLOUD)
    assert prediction.state is None, f"answer {prediction.state}"
    return "no state, with the reason"


def write_graph(
    path: Path, row: Sequence[float], door: float | None = None, reason: AbstentionCode | None = None
) -> None:
    """Write an exported network that gives the same outputs for every cloud.

    Args:
        path: file to write.
        row: probabilities of the states.
        door: output of the head `door`; None: the file is one of version 0.1, without heads and reasons.
        reason: output `reason`.
    """
    shape: list[Any] = ["batch", MIN_POINTS, 3]
    points = helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, shape)
    values = {PROBABILITIES if door is None else RAW_PROBABILITIES: np.float32(row)}
    if door is not None:
        values |= {DOOR: np.float32([door]), REASON: np.int64(REASONS.index(reason))}
    constants = [numpy_helper.from_array(np.array(value), f"{name}.value") for name, value in values.items()]
    constants.append(numpy_helper.from_array(np.int64([1, 2]), "axes"))
    nodes = [helper.make_node("ReduceMean", [INPUT, "axes"], ["mean"], keepdims=0)]  # (batch,)
    nodes.append(helper.make_node("Shape", ["mean"], ["batch"]))
    outputs = []
    for name, value in values.items():
        kind = helper.np_dtype_to_tensor_dtype(value.dtype)
        outputs.append(helper.make_tensor_value_info(name, kind, ["batch", *value.shape]))
        constants.append(numpy_helper.from_array(np.array(value.shape, np.int64), f"{name}.width"))
        nodes.append(helper.make_node("Concat", ["batch", f"{name}.width"], [f"{name}.shape"], axis=0))
        nodes.append(helper.make_node("Expand", [f"{name}.value", f"{name}.shape"], [name]))
    graph = helper.make_graph(nodes, "g", [points], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    describe(model, CARD if door is None else CARD.model_copy(update={"heads": (DOOR,)}))
    path.write_bytes(add_digest(model.SerializeToString()))


def _prediction(state: DoorState, probabilities: Mapping[str, float]) -> Prediction:
    return Prediction(state, 500, 1.0, raw_probabilities=probabilities)


def _closed() -> Prediction:
    return _prediction(DoorState.CLOSED, {"closed": 0.9, "semi_open": 0.06, "open": 0.04})


def _filter(broken: Prediction) -> str:
    state_filter = StateFilter()
    for number in range(60):
        filtered = state_filter.update(broken if number == 5 else _closed(), number / 10)
        assert all(map(math.isfinite, filtered.probabilities.values())), "NaN"
        assert filtered.state in (None, DoorState.CLOSED), f"{filtered.state}"
    assert filtered.state == DoorState.CLOSED, "the filter stays without a state"
    return "ignored"


def _wait(broken: Prediction) -> str:
    stream = [(number / 10, broken if number % 3 else _closed()) for number in range(100)]
    assert not wait_for("open", stream, timeout_s=9), "open"
    return "ignored"
