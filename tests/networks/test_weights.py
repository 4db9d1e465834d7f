# SPDX-License-Identifier: Apache-2.0
"""Weights survive the file; files that do not fit are refused."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
import torch
from pydantic import ValidationError
from safetensors.torch import save_file

from doorstate.errors import WeightsError
from doorstate.networks import create_network, list_networks
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.networks.tensor_file import read_tensors
from doorstate.networks.weights import load_weights, save_weights


@pytest.mark.parametrize("name", list_networks())
def test_a_network_survives_the_file(name: str, tmp_path: Path) -> None:
    network = create_network(name, batchnorm_eps=1e-3).eval()
    card = WeightsCard(network=name, network_options={"batchnorm_eps": 1e-3}, num_points=256)
    save_weights(tmp_path / "w.safetensors", network, card)
    loaded, loaded_card = load_weights(tmp_path / "w.safetensors")
    points = torch.rand(2, 256, 3)
    with torch.no_grad():
        torch.testing.assert_close(loaded(points), network(points), rtol=0, atol=0)
    assert loaded_card == card
    assert not loaded.training


def test_half_precision_halves_the_file_and_hardly_changes_the_probabilities(tmp_path: Path) -> None:
    network = create_network("pointnet2").eval()
    card = WeightsCard(network="pointnet2", num_points=256)
    save_weights(tmp_path / "full.safetensors", network, card)
    save_weights(tmp_path / "half.safetensors", network, card, half=True)
    sizes = [(tmp_path / f"{name}.safetensors").stat().st_size for name in ("half", "full")]
    assert sizes[0] < 0.55 * sizes[1]
    loaded, _ = load_weights(tmp_path / "half.safetensors")
    assert all(p.dtype == torch.float32 for p in loaded.parameters())
    points = torch.rand(2, 256, 3)
    with torch.no_grad():
        torch.testing.assert_close(loaded(points).softmax(1), network(points).softmax(1), rtol=0, atol=5e-3)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "gone.safetensors"
    with pytest.raises(WeightsError) as caught:
        read_card(path)
    assert caught.value.path == path


@pytest.mark.parametrize("data", [b"", b"{}", b"\xff" * 100, pickle.dumps({"a": 1})])
def test_files_of_other_formats_are_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    path.write_bytes(data)
    with pytest.raises(WeightsError) as caught:
        load_weights(path)
    assert caught.value.path == path


def test_safetensors_without_a_card_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(WeightsError) as caught:
        load_weights(path)
    assert caught.value.path == path


@pytest.mark.parametrize(
    "card",
    [
        WeightsCard(network="dgcnn", num_points=256),
        WeightsCard(network="pointnet", num_points=256, scale_m=1.0),
        WeightsCard(network="pointnet", num_points=256, states=("open", "closed")),
    ],
)
def test_weights_of_another_network_scale_or_states_are_refused(card: WeightsCard, tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save_weights(path, create_network("pointnet"), card)
    with pytest.raises(WeightsError) as caught:
        load_weights(path)
    assert caught.value.path == path


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_one_number_that_is_not_finite_is_refused(number: float, tmp_path: Path) -> None:
    network, path = create_network("pointnet"), tmp_path / "w.safetensors"
    name, tensor = next((name, tensor) for name, tensor in network.state_dict().items() if tensor.dim() == 2)
    with torch.no_grad():
        tensor[0, 0] = number
    save_weights(path, network, WeightsCard(network="pointnet", num_points=128))
    for read in (load_weights, read_tensors):
        with pytest.raises(WeightsError) as caught:
            read(path)  # type: ignore[operator]
        assert (caught.value.path, caught.value.field) == (path, name)


@pytest.mark.parametrize("dtype", [torch.int64, torch.float32])
def test_weights_of_another_type_are_refused(tmp_path: Path, dtype: torch.dtype) -> None:
    network, path = create_network("pointnet"), tmp_path / "w.safetensors"
    card = WeightsCard(network="pointnet", num_points=128)
    tensors = {name: tensor.to(dtype) for name, tensor in network.state_dict().items()}
    save_file(tensors, path, metadata={CARD_KEY: card.model_dump_json()})
    with pytest.raises(WeightsError) as caught:
        load_weights(path)
    assert caught.value.path == path
    assert tensors[str(caught.value.field)].is_floating_point() == dtype.is_floating_point


@pytest.mark.parametrize("temperature", [0.0, 1e-300, 1e300, float("inf"), float("nan")])
def test_impossible_temperatures_are_refused(temperature: float) -> None:
    with pytest.raises(ValidationError):
        WeightsCard(network="pointnet", num_points=128, temperature=temperature)
