# SPDX-License-Identifier: Apache-2.0
"""Every network against its plain form: logits, and everything that a training step changes."""

from __future__ import annotations

import copy
from functools import cache
from math import hypot
from typing import Any, NamedTuple

import pytest
import torch
from torch import Tensor, nn

from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.layers.batch_norm import set_batchnorm
from tests.networks.plain_networks import PlainForm

CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "pointnet": ("pointnet", {}),
    "pointnet2": ("pointnet2", {}),
    "pointnet2-msg": ("pointnet2", {"variant": "msg", "num_samples": 24}),
    "dgcnn": ("dgcnn", {}),
    "pointcnn": ("pointcnn", {}),
    "point2sequence": ("point2sequence", {}),
    "point2sequence-released": ("point2sequence", {"region_feature": "released"}),
}
LABELS = torch.tensor([0, 2, 1])
TOLERANCES = {torch.float64: 1e-9, torch.float32: 1e-4}

every_case = pytest.mark.parametrize("case", CASES)
every_layer = pytest.mark.parametrize("case", [case for case in CASES if case != "point2sequence-released"])


def clouds(batch: int, num_points: int, seed: int = 0) -> Tensor:
    """Boxes of different shapes, redrawn until no float32 rounding can change the order of neighbours."""
    generator = torch.Generator().manual_seed(seed)
    accepted: list[Tensor] = []
    while len(accepted) < batch:
        points = torch.rand(num_points, 3, generator=generator) - 0.5
        points *= 0.3 + torch.rand(3, generator=generator)
        distances = (points.double().unsqueeze(1) - points.double()).square().sum(-1)
        nearest = distances.topk(50, largest=False).values[:, 1:]
        if (nearest.diff() > 1e-6 * nearest[:, 1:]).all():
            accepted.append(points)
    return torch.stack(accepted)


@cache
def trained(case: str) -> PointNetwork:
    """A network no parameter of which is zero, with scales of both signs and statistics near those of data."""
    torch.manual_seed(0)
    name, options = CASES[case]
    network = create_network(name, batchnorm_eps=1e-3, **options)
    for parameter in network.parameters():
        if not parameter.any():
            nn.init.uniform_(parameter, -0.02, 0.02)
    norms = [module for module in network.modules() if isinstance(module, nn.BatchNorm1d)]
    for norm in norms:
        nn.init.uniform_(norm.weight, -1, 1)
    set_batchnorm(network, momentum=1.0)
    with torch.no_grad():
        PlainForm(network)(clouds(6, 128, seed=1))
    set_batchnorm(network, momentum=0.1)
    for norm in norms:
        norm.running_mean += norm.running_var.sqrt() * torch.empty_like(norm.running_mean).uniform_(-0.2, 0.2)
        norm.running_var *= torch.empty_like(norm.running_var).uniform_(0.5, 1.5)
    return network


def twins(case: str, dtype: torch.dtype) -> tuple[PointNetwork, PlainForm]:
    """Two equal networks, the second to be computed plainly."""
    network = copy.deepcopy(trained(case)).to(dtype)
    return network, PlainForm(copy.deepcopy(network))


class Step(NamedTuple):
    """Loss, logits and gradients of one training step."""

    loss: Tensor
    logits: Tensor
    gradients: dict[str, Tensor | None]


def training_step(form: nn.Module, network: PointNetwork, points: Tensor) -> Step:
    torch.manual_seed(7)  # the same dropout
    # With an epsilon above the rounding noise that is the gradient of a bias before a normalisation.
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=0.1, eps=1e-3)
    loss, logits = form.training_loss(points, LABELS, label_smoothing=0.1)
    loss.backward()
    optimizer.step()
    return Step(loss.detach(), logits.detach(), {name: p.grad for name, p in network.named_parameters()})


@cache
def plain_step(case: str) -> tuple[Step, PointNetwork]:
    """A step of the plain form in double precision, and the network after it."""
    _, plain = twins(case, torch.float64)
    return training_step(plain, plain.network, clouds(3, 128).double()), plain.network


def assert_same_gradients(fast: Step, plain: Step, tolerance: float) -> None:
    """Compare to a share of the norm, or of a hundredth of the norm of all: some gradients are zero but for noise."""
    unused = [name for name, gradient in plain.gradients.items() if gradient is None]
    assert [name for name, gradient in fast.gradients.items() if gradient is None] == unused
    norms = {name: g.norm().item() for name, g in plain.gradients.items() if g is not None}
    floor = 0.01 * hypot(*norms.values())
    for name, norm in norms.items():
        error = (fast.gradients[name] - plain.gradients[name]).norm().item()
        assert error <= tolerance * (norm + floor), f"gradient of {name}, norm {norm}, is off by {error}"


def assert_same_tensors(fast: dict[str, Tensor], plain: dict[str, Tensor], tolerance: float) -> None:
    assert fast.keys() == plain.keys()
    for name, expected in plain.items():
        torch.testing.assert_close(
            fast[name],
            expected,
            rtol=tolerance,
            atol=tolerance,
            msg=lambda text, name=name: f"{name}: {text}",
        )


@every_case
@pytest.mark.parametrize(
    ("dtype", "batch", "num_points"),
    [
        (torch.float64, 3, 128),
        (torch.float64, 1, 256),
        (torch.float32, 3, 256),
        (torch.float32, 1, 640),  # the centres are the first points only
    ],
    ids=str,
)
def test_logits(case: str, dtype: torch.dtype, batch: int, num_points: int) -> None:
    network, plain = twins(case, dtype)
    points = clouds(batch, num_points).to(dtype)
    with torch.inference_mode():
        logits, expected = network.eval()(points), plain.eval()(points)
    assert batch == 1 or expected.std(0).max() > 0.1  # clouds matter
    torch.testing.assert_close(logits, expected, rtol=TOLERANCES[dtype], atol=TOLERANCES[dtype])


@every_case
def test_training_step(case: str) -> None:
    network, _ = twins(case, torch.float64)
    fast = training_step(network, network, clouds(3, 128).double())
    expected, plain_network = plain_step(case)
    torch.testing.assert_close(fast.loss, expected.loss, rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(fast.logits, expected.logits, rtol=1e-9, atol=1e-9)
    assert_same_gradients(fast, expected, 1e-9)
    assert_same_tensors(network.state_dict(), plain_network.state_dict(), 1e-9)


@every_layer
def test_training_step_in_single_precision(case: str) -> None:
    """Against double precision: of ten thousand rows, torch's own float32 statistics are off by 1e-5.

    Such an error may also choose another point for a maximum, which moves gradients more than logits.
    """
    network, _ = twins(case, torch.float32)
    fast = training_step(network, network, clouds(3, 128))
    expected, plain_network = plain_step(case)
    torch.testing.assert_close(fast.loss.double(), expected.loss, rtol=3e-3, atol=3e-3)
    torch.testing.assert_close(fast.logits.double(), expected.logits, rtol=3e-3, atol=3e-3)
    assert_same_gradients(fast, expected, 0.15)
    assert_same_tensors(dict(network.double().named_buffers()), dict(plain_network.named_buffers()), 1e-3)


@every_layer
def test_repeated_points(case: str) -> None:
    network, plain = twins(case, torch.float64)
    points = clouds(3, 96).double()
    points = torch.cat([points, points[:, :32]], dim=1)
    with torch.inference_mode():
        logits, expected_logits = network.eval()(points[:1]), plain.eval()(points[:1])
    torch.testing.assert_close(logits, expected_logits, rtol=1e-9, atol=1e-9)
    network.train()
    plain.train()
    fast, expected = training_step(network, network, points), training_step(plain, plain.network, points)
    torch.testing.assert_close(fast.logits, expected.logits, rtol=1e-9, atol=1e-9)
    assert_same_gradients(fast, expected, 1e-9)


@every_layer
def test_plain_form_under_autocast(case: str) -> None:
    _, plain = twins(case, torch.float32)
    points = clouds(3, 128)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        step = training_step(plain, plain.network, points)
        logits = plain.eval()(points)
    assert step.loss.dtype == step.logits.dtype == logits.dtype == torch.float32
    assert all(g is None or g.isfinite().all() for g in step.gradients.values())
