# SPDX-License-Identifier: Apache-2.0
"""Exported files refuse what a predictor refuses, in onnxruntime alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from numpy.typing import NDArray

from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.decode import decode
from doorstate.inference.export import export_onnx
from doorstate.inference.export.refusals import REASONS
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads
from doorstate.networks.heads import HEADS
from doorstate.types import STATES, Points

NUM_POINTS, MAX_DEPTH_M = 128, 5.0
MASKED = ("angle", "hinge", "frame", "widths")


def door(seed: int = 0) -> Points:
    """Return (128, 3) metres of a wall three metres away, as wide as a door is seen."""
    rng = np.random.default_rng(seed)
    return rng.uniform((2.9, -1.5, -0.9), (3.1, 1.5, 1.1), (NUM_POINTS, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def network() -> PointNetwork:
    torch.manual_seed(3)
    network = create_network("pointnet")
    add_heads(network, tuple(HEADS))
    return network.eval()


def exported(network: PointNetwork, folder: Path, **card: float) -> Path:
    fields = {"num_points": NUM_POINTS, "heads": tuple(HEADS), "max_depth_m": MAX_DEPTH_M} | card
    clouds = LabelledClouds(np.stack([door(seed) for seed in range(3)]), np.arange(3))
    path = folder / "door.onnx"
    export_onnx(path, network, WeightsCard(network="pointnet", **fields), clouds)
    return path


@pytest.fixture(scope="module")
def session(network: PointNetwork, tmp_path_factory: pytest.TempPathFactory) -> onnxruntime.InferenceSession:
    set_door(network, 9.0)
    return onnxruntime.InferenceSession(exported(network, tmp_path_factory.mktemp("sees")))


def set_door(network: PointNetwork, bias: float) -> None:
    torch.nn.init.constant_(network.heads["door"].linear.bias, bias)  # type: ignore[union-attr, arg-type]


def run(session: onnxruntime.InferenceSession, points: Points) -> Mapping[str, NDArray[np.float32]]:
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(None, {"points": points}), strict=True))


def check_refused(outputs: Mapping[str, NDArray[np.float32]], code: str) -> None:
    assert outputs["state"].tolist() == [-1]
    assert REASONS[int(outputs["reason"][0])] == code
    assert not outputs["probabilities"].any()
    assert all(np.isnan(outputs[name]).all() for name in MASKED)


def test_a_door_has_a_state_and_numbers(session: onnxruntime.InferenceSession, network: PointNetwork) -> None:
    points = np.stack([door(seed) for seed in range(4)])
    outputs = run(session, points)
    assert outputs["state"].tolist() == outputs["raw_probabilities"].argmax(1).tolist()
    assert outputs["reason"].tolist() == [0] * 4
    np.testing.assert_array_equal(outputs["probabilities"], outputs["raw_probabilities"])
    assert all(np.isfinite(outputs[name]).all() for name in MASKED)


WRONG = {
    "unusable_cloud": [
        lambda points: np.where(np.arange(NUM_POINTS)[:, None] == 5, np.nan, points),
        lambda points: np.where(np.arange(NUM_POINTS)[:, None] == 5, np.inf, points),
        lambda points: np.where(np.arange(NUM_POINTS)[:, None] == 5, 0, points),
        lambda points: points + np.array([MAX_DEPTH_M, 0, 0]),
        lambda points: points * 1000,
    ],
    "points_behind_camera": [lambda points: points[:, [1, 2, 0]], lambda points: -points],
    "too_near": [lambda points: points * 0.15],
    "too_small": [lambda points: points * [1, 1, 0.1], lambda points: points * [1, 0.1, 1]],
    "narrow_view": [lambda points: points * [1.6, 0.5, 1]],
}


@pytest.mark.parametrize(
    ("code", "damage"), [(code, damage) for code, all_ in WRONG.items() for damage in all_]
)
def test_what_no_camera_sees_of_a_door_is_refused(
    session: onnxruntime.InferenceSession, code: str, damage: object
) -> None:
    check_refused(run(session, damage(door()).astype(np.float32)[None]), code)  # type: ignore[operator]


def test_no_door_is_refused(network: PointNetwork, tmp_path: Path) -> None:
    set_door(network, -9.0)
    outputs = run(onnxruntime.InferenceSession(exported(network, tmp_path)), door()[None])
    check_refused(outputs, "no_door")
    assert outputs["door"][0, 0] < 0.01


def test_an_unsure_network_is_refused(network: PointNetwork, tmp_path: Path) -> None:
    set_door(network, 9.0)
    clouds = np.stack([door(seed) for seed in range(8)])
    card = WeightsCard(network="pointnet", num_points=NUM_POINTS, heads=tuple(HEADS), temperature=0.01)
    threshold = float(np.median(TorchBackend(network, card)(clouds).probabilities.max(1))) + 1e-6
    path = exported(network, tmp_path, abstain_below=threshold, temperature=0.01)
    outputs = run(onnxruntime.InferenceSession(path), clouds)
    refused = outputs["state"] == -1
    assert 0 < refused.sum() < 8
    assert {REASONS[number] for number in outputs["reason"][refused]} == {"unsure"}
    assert not outputs["probabilities"][refused].any()
    backend = OnnxBackend(path)
    for cloud, state, reason in zip(clouds, outputs["state"], outputs["reason"], strict=True):
        (of_cloud,) = backend(cloud[None]).per_cloud()
        prediction = decode(of_cloud, threshold, NUM_POINTS, 0.0)
        assert prediction.state == (None if state == -1 else STATES[state])
        assert (prediction.abstention and prediction.abstention.code) == REASONS[reason]
    predicted = NetworkPredictor(backend, gate=None).batch(list(clouds))
    assert [prediction.state is None for prediction in predicted] == refused.tolist()


def test_metadata_list_every_output_and_what_is_left(session: onnxruntime.InferenceSession) -> None:
    metadata = session.get_modelmeta().custom_metadata_map
    listed = json.loads(metadata["outputs"])
    types = {"tensor(int64)": "int64", "tensor(float)": "float32"}
    assert [(output["name"], output["type"], len(output["shape"])) for output in listed] == [
        (output.name, types[output.type], len(output.shape)) for output in session.get_outputs()
    ]
    assert [output["shape"][1:] for output in listed] == [
        output.shape[1:] for output in session.get_outputs()
    ]
    assert json.loads(metadata["reasons"]) == [code or "" for code in REASONS]
    assert json.loads(metadata["gate"])["min_view_deg"] == 40.0
    assert json.loads(metadata["doorstate"])["max_depth_m"] == MAX_DEPTH_M
    assert metadata["left_to_the_program"]
