# SPDX-License-Identifier: Apache-2.0
"""Networks with heads: shapes, gradients, missing targets; a network without heads is unchanged."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from doorstate.errors import ConfigError
from doorstate.networks import create_network, list_networks
from doorstate.networks.base import PointNetwork
from doorstate.networks.head_layers import Head, add_heads, head_outputs, joint_losses
from doorstate.networks.heads import HEADS

WITH_PARTS = ("pointnet", "pointnet2", "dgcnn")
LABELS = torch.tensor([0, -100, 1])


def clouds(num_points: int = 160) -> Tensor:
    return torch.rand(3, num_points, 3, generator=torch.Generator().manual_seed(1)) * 2 - 1


def targets(num_points: int = 160) -> dict[str, Tensor]:
    """Targets of three clouds, the second without a door."""
    nan = math.nan
    return {
        "door": torch.tensor([[1.0], [0.0], [1.0]]),
        "angle": torch.tensor([[0.1], [nan], [1.2]]),
        "hinge": torch.tensor([[1.0], [nan], [0.0]]),
        "frame": torch.tensor([[0.2, -0.1, 3.0], [nan] * 3, [0.3, 0.0, -3.1]]),
        "widths": torch.tensor([[0.3, 0.0], [nan] * 2, [0.31, 0.2]]),
        "parts": torch.arange(3 * num_points).reshape(3, num_points) % 7 - 1,
    }


def headed(name: str) -> PointNetwork:
    torch.manual_seed(0)
    network = create_network(name)
    add_heads(network, [*HEADS, *(["parts"] if name in WITH_PARTS else [])])
    return network


@pytest.mark.parametrize("name", list_networks())
def test_every_network_takes_every_head(name: str) -> None:
    network = headed(name).eval()
    with torch.inference_mode():
        outputs = head_outputs(network, clouds())
        logits = network(clouds())
    assert {key: tuple(value.shape) for key, value in outputs.items() if key in HEADS} == {
        "door": (3, 1),
        "angle": (3, 1),
        "hinge": (3, 1),
        "frame": (3, 3),
        "widths": (3, 2),
    }
    assert torch.equal(outputs["state"], logits)
    assert logits.shape == (3, 3)
    assert all(value.isfinite().all() and value.dtype == torch.float32 for value in outputs.values())
    if name in WITH_PARTS:
        assert outputs["parts"].shape == (3, 160, 6)


@pytest.mark.parametrize("name", list_networks())
def test_training_lowers_the_losses_and_every_parameter_has_a_gradient(name: str) -> None:
    network = headed(name).train()
    optimizer = torch.optim.Adam(network.parameters(), 3e-4)
    totals = []
    for _ in range(6):
        torch.manual_seed(2)  # the same dropout every time
        losses, _ = joint_losses(network, clouds(), LABELS, targets())
        total = sum(losses.values(), torch.zeros(()))
        totals.append(float(total.detach()))
        optimizer.zero_grad()
        total.backward()  # type: ignore[no-untyped-call]
        assert all(p.grad is not None and p.grad.isfinite().all() for p in network.parameters())
        optimizer.step()
    assert set(losses) == {"state", *network.heads}
    assert totals[-1] < 0.9 * totals[0]


@pytest.mark.parametrize("name", list_networks())
def test_without_heads_the_parameters_are_those_of_the_paper(name: str) -> None:
    torch.manual_seed(0)
    plain = create_network(name)
    with_heads = headed(name)
    own = {key: value for key, value in with_heads.state_dict().items() if not key.startswith("heads.")}
    assert list(own) == list(plain.state_dict())
    assert all(torch.equal(own[key], value) for key, value in plain.state_dict().items())


@pytest.mark.parametrize("name", WITH_PARTS)
def test_parts_follow_their_points(name: str) -> None:
    """A permutation of the points after the centres permutes their parts."""
    network = headed(name).double().eval()
    points = clouds(700).double()
    order = torch.cat(
        [torch.arange(512), 512 + torch.randperm(188, generator=torch.Generator().manual_seed(3))]
    )
    with torch.inference_mode():
        parts, moved_parts = (head_outputs(network, cloud)["parts"] for cloud in (points, points[:, order]))
    torch.testing.assert_close(moved_parts, parts[:, order], atol=1e-9, rtol=0)
    assert parts.std(dim=1).min() > 1e-6


@pytest.mark.parametrize("name", WITH_PARTS)
@pytest.mark.parametrize("count", [60, 400])
def test_parts_of_the_first_points_are_those_of_all(name: str, count: int) -> None:
    network = headed(name).double().eval()
    points = clouds(700).double()
    parts = torch.randint(-1, 6, (3, 700), generator=torch.Generator().manual_seed(5))
    all_targets = {key: value.double() for key, value in targets().items()} | {"parts": parts}
    with torch.inference_mode():
        every = head_outputs(network, points)["parts"]
        encoding = network.encode(points)
        first = network.heads["parts"](points[:, :count], encoding)
        losses, _ = joint_losses(network, points, LABELS, all_targets, part_points=count)
    torch.testing.assert_close(first, every[:, :count], atol=1e-9, rtol=0)
    has_part = parts[:, :count] >= 0
    expected = torch.nn.functional.cross_entropy(every[:, :count][has_part], parts[:, :count][has_part])
    torch.testing.assert_close(losses["parts"], expected)


def test_missing_targets_have_no_loss() -> None:
    network = headed("pointnet2").train()
    missing = {key: torch.full_like(value, math.nan) for key, value in targets().items() if key in HEADS}
    missing["parts"] = torch.full((3, 160), -1)
    losses, _ = joint_losses(network, clouds(), torch.full((3,), -100), missing)
    assert float(losses["state"].detach()) == 0
    assert all(float(losses[key].detach()) == 0 for key in missing)
    sum(losses.values(), torch.zeros(())).backward()  # type: ignore[no-untyped-call]
    assert not any(p.grad is not None and p.grad.any() for p in network.heads.parameters())


def test_loss_is_the_mean_over_clouds_with_a_target() -> None:
    network = headed("pointnet").eval()
    with torch.inference_mode():
        losses, _ = joint_losses(network, clouds(), LABELS, targets())
        features = network.features(clouds())
    for key, target in targets().items():
        if key in HEADS:
            head = network.heads[key]
            assert isinstance(head, Head)
            with torch.inference_mode():
                per_cloud = head.spec.loss(head(features), target.nan_to_num())
            with_target = per_cloud if key == "door" else per_cloud[[0, 2]]
            torch.testing.assert_close(losses[key], with_target.mean())


def test_unknown_heads_are_refused() -> None:
    network = create_network("point2sequence")
    with pytest.raises(ConfigError, match="unknown head 'angel'; did you mean 'angle'"):
        add_heads(network, ["angel"])
    with pytest.raises(ConfigError, match="Point2Sequence has no per-point branch"):
        add_heads(network, ["parts"])
