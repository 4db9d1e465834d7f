# SPDX-License-Identifier: Apache-2.0
"""Names of devices, with and without CUDA."""

from __future__ import annotations

import pytest
import torch

from doorstate._devices import check_device_name, describe_device, has_fast_bf16, resolve_device
from doorstate.errors import ConfigError


@pytest.fixture
def _two_gpus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)


@pytest.fixture
def _no_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


@pytest.mark.usefixtures("_two_gpus")
@pytest.mark.parametrize(
    ("name", "device"),
    [("cpu", "cpu"), ("auto", "cuda:0"), ("cuda", "cuda:0"), ("cuda:1", "cuda:1")],
)
def test_names_with_cuda(name: str, device: str) -> None:
    assert str(resolve_device(name)) == device


@pytest.mark.usefixtures("_two_gpus")
def test_a_device_that_is_not_there() -> None:
    with pytest.raises(ConfigError) as refused:
        resolve_device("cuda:2")
    assert (refused.value.field, refused.value.expected) == ("device", "cuda:0 to cuda:1")


@pytest.mark.usefixtures("_no_gpu")
def test_names_without_cuda() -> None:
    assert str(resolve_device("auto")) == "cpu"
    with pytest.raises(ConfigError) as refused:
        resolve_device("cuda")
    assert (refused.value.field, refused.value.expected) == ("device", "cpu")
    assert refused.value.hint


@pytest.mark.parametrize("name", ["", "gpu", "cuda:", "cuda:x", "cuda:-1", "mps"])
def test_unknown_names(name: str) -> None:
    with pytest.raises(ConfigError) as refused:
        check_device_name(name)
    assert refused.value.field == "device"


def test_description_and_precision_of_the_processor() -> None:
    cpu = torch.device("cpu")
    assert describe_device(cpu) == "cpu"
    assert has_fast_bf16(cpu) == has_fast_bf16()
