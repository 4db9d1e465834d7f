# SPDX-License-Identifier: Apache-2.0
"""Backend and device of weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from doorstate.errors import ConfigError, WeightsError
from doorstate.inference.backends import load_backend, loading, needs_torch
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.backends.torch_backend import TorchBackend


@pytest.fixture
def _no_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


@pytest.mark.usefixtures("_no_gpu")
def test_without_cuda_auto_is_the_processor() -> None:
    assert isinstance(load_backend("pointnet2", device="auto"), OnnxBackend)
    with pytest.raises(ConfigError) as refused:
        load_backend("pointnet2", device="cuda")
    assert refused.value.field == "device"


def test_a_device_takes_torch(monkeypatch: pytest.MonkeyPatch, weights: Path) -> None:
    """The meta device stands for CUDA: weights are there, results are not."""
    monkeypatch.setattr(loading, "resolve_device", lambda name: torch.device("meta"))
    for name in ("pointnet2", weights):
        for device in ("cuda", "auto"):
            backend = load_backend(name, device=device)
            assert isinstance(backend, TorchBackend)
            assert {tensor.device.type for tensor in backend.network.state_dict().values()} == {"meta"}


def test_exported_networks_run_on_the_processor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(loading, "resolve_device", lambda name: torch.device("meta"))
    graph = tmp_path / "network.onnx"
    with pytest.raises(WeightsError):  # there is no such file
        load_backend(graph, device="auto")
    for arguments in ((graph, None, None), ("pointnet2", None, "onnxruntime")):
        with pytest.raises(ConfigError) as refused:
            load_backend(*arguments, device="cuda:1")
        assert (refused.value.field, refused.value.expected) == ("device", "cpu")


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (("pointnet2",), False),
        (("pointnet2", "torch"), True),
        (("pointnet2", None, "cuda:1"), True),
        (("pointnet2", None, "auto"), True),
        (("pointnet2", "onnxruntime", "auto"), False),
        ((Path("net.safetensors"),), True),
        (("net.onnx", None, "auto"), False),
        (("",), False),
    ],
)
def test_torch_is_needed_for_its_files_and_for_devices(arguments: tuple[Any, ...], needed: bool) -> None:
    assert needs_torch(*arguments) is needed


def test_every_device_answers_as_the_processor() -> None:
    if not torch.cuda.is_available():
        pytest.skip("no CUDA device")
    points = np.random.default_rng(0).normal(2, 1, (2, 1024, 3)).astype(np.float32)
    expected = load_backend("pointnet2", backend="torch")(points)
    got = load_backend("pointnet2", device="cuda")(points)
    np.testing.assert_allclose(got.probabilities, expected.probabilities, atol=2e-3)
    for name, column in expected.heads.items():
        np.testing.assert_allclose(got.heads[name], column, atol=0.02)
