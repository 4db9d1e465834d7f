# SPDX-License-Identifier: Apache-2.0
"""Networks and searches on every device that is there, against the CPU: outputs, gradients, ties and duplicates."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import Tensor

from doorstate.networks import create_network, list_networks
from doorstate.networks.base import PointNetwork
from doorstate.networks.head_layers import add_heads, joint_losses
from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.kernels.knn import knn
from tests.networks import plain
from tests.networks.device_forms import device_forms
from tests.networks.twins import random_rows

NAMES = (*list_networks(), "mvcnn")
LABELS = torch.tensor([0, 2, 1])
Results = dict[str, Tensor]


def grid(count: int, seed: int) -> Tensor:
    """Clouds on a coarse grid, with ties and duplicates, whose distances are exact."""
    return (random_rows(2, count, 3, seed=seed) * 2).round() / 2


def training_results(network: PointNetwork, points: Tensor) -> Results:
    """Loss, logits, running statistics and all gradients of a training step, and logits in evaluation."""
    torch.manual_seed(0)
    for module in network.modules():
        if isinstance(module, torch.nn.Dropout):  # devices draw other numbers
            module.p = 0.0
    loss, logits = network.train().training_loss(points, LABELS.to(points.device), 0.1)
    loss.backward()
    results = {"loss": loss, "logits": logits}
    results |= {f"grad {name}": p.grad for name, p in network.named_parameters() if p.grad is not None}
    results |= dict(network.named_buffers())
    with torch.no_grad():
        return results | {"evaluated": network.eval()(points)}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-8), (torch.float32, 2e-2)])
def test_networks_train_as_on_the_cpu(
    name: str, dtype: torch.dtype, tolerance: float, device: torch.device
) -> None:
    """Relative to the norm of each tensor; in float32 one rounding can change which point wins a maximum."""
    network = create_network(name).to(dtype)
    points = torch.rand(3, 160, 3, generator=torch.Generator().manual_seed(4)).to(dtype) * 2 - 1
    expected = training_results(copy.deepcopy(network), points)
    with device_forms():
        got = training_results(network.to(device), points.to(device))
    assert got.keys() == expected.keys()
    scale = max(value.norm() for name, value in expected.items() if name.startswith("grad"))
    for key, value in expected.items():
        # Biases before a normalisation have the gradient 0 but for rounding.
        size = value.double().norm() + (1e-3 * scale if key.startswith("grad") else 0)
        assert (got[key].cpu() - value).double().norm() <= tolerance * size, key


@pytest.mark.parametrize("name", NAMES)
def test_autocast_trains_on_the_device(name: str, device: torch.device) -> None:
    network = create_network(name).to(device)
    points = torch.rand(3, 160, 3, generator=torch.Generator().manual_seed(4)).to(device)
    with device_forms(), torch.autocast(device.type, dtype=torch.bfloat16):
        loss, _ = network.training_loss(points, LABELS.to(device))
        loss.backward()
    assert loss.dtype == torch.float32
    assert all(p.grad is not None and p.grad.isfinite().all() for p in network.parameters())


@pytest.mark.parametrize("seed", range(4))
def test_searches_find_ties_and_duplicates_in_order_of_index(seed: int, device: torch.device) -> None:
    points = grid(40, seed)
    queries = points[:, :9]
    place = points.to(device)
    with device_forms():
        balls = ball_query(place[:, :9], place, 1.1, 6).cpu()
        nearest = knn(place[:, :9], place, 12).cpu()
    assert torch.equal(balls, plain.ball_query(queries, points, 1.1, 6))
    first = nearest[..., 0]
    assert torch.equal(first, torch.arange(9).expand(2, -1)), "the query itself"
    distances = (queries.unsqueeze(2) - points.unsqueeze(1)).square().sum(-1)
    distances.scatter_(2, torch.arange(9).expand(2, -1).unsqueeze(2), -1.0)
    assert torch.equal(nearest, distances.argsort(dim=-1, stable=True)[..., :12])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_searches_equal_those_of_the_cpu(dtype: torch.dtype, device: torch.device) -> None:
    """With ties and duplicates, in the CPU's search between blocks, too."""
    half = grid(768, 7).to(dtype)
    points = torch.cat([half, -half], dim=1)  # the CPU subtracts the mean, which is exactly 0
    features = torch.cat([points, points.flip(2)], dim=2)
    expected = [
        ball_query(points[:, :50], points, 0.6, 32),
        knn(points.float(), points.float(), 16),
        knn(features.float(), features.float(), 16),
    ]
    place, features = points.to(device), features.to(device)
    with device_forms():
        assert torch.equal(ball_query(place[:, :50], place, 0.6, 32).cpu(), expected[0])
        assert torch.equal(knn(place, place, 16).cpu(), expected[1])
        assert torch.equal(knn(features, features, 16).cpu(), expected[2])


@pytest.mark.parametrize("has_doors", [True, False])
def test_losses_of_heads_wait_for_no_device(has_doors: bool) -> None:
    network = create_network("pointnet")
    add_heads(network, ["door"])
    labels = LABELS if has_doors else torch.full_like(LABELS, -100)
    points = torch.rand(3, 160, 3, generator=torch.Generator().manual_seed(4))
    targets = {"door": torch.ones(3, 1)}
    losses, _ = joint_losses(network, points, labels, targets)
    assert losses["state"].isfinite()
    assert bool(losses["state"] > 0) == has_doors
    sum(losses.values()).backward()
    assert all(p.grad is not None and p.grad.isfinite().all() for p in network.parameters())
    on_meta = {name: target.to("meta") for name, target in targets.items()}
    joint_losses(network.to("meta"), points.to("meta"), labels.to("meta"), on_meta)
