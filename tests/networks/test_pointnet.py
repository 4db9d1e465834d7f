# SPDX-License-Identifier: Apache-2.0
"""PointNet: transforms that start as identities, the regulariser, invariance to order."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from doorstate.networks.pointnet import PointNet, TransformNet, orthogonality_penalty


def clouds(batch: int = 2, num_points: int = 128) -> Tensor:
    return torch.rand(batch, num_points, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1


@pytest.mark.parametrize("size", [3, 64])
def test_transform_is_exactly_the_identity_before_training(size: int) -> None:
    rows = torch.randn(2, 128, size, generator=torch.Generator().manual_seed(0)) * 5
    assert torch.equal(TransformNet(size)(rows), torch.eye(size).expand(2, -1, -1))


def test_untrained_network_equals_the_one_without_transforms() -> None:
    network = PointNet().eval()
    rows = network.encoder(network.local(clouds()))
    assert torch.equal(network(clouds()), network.head(rows))


def test_points_are_row_vectors_to_the_transforms() -> None:
    network = PointNet().eval()
    quarter_turn = torch.tensor([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    with torch.no_grad():
        network.input_transform.output.bias.copy_((quarter_turn - torch.eye(3)).flatten())
    x, y, z = clouds().unbind(-1)
    with torch.no_grad():
        turned = network(clouds())
        network.input_transform.output.bias.zero_()
        torch.testing.assert_close(turned, network(torch.stack([-y, x, z], dim=-1)))


def test_feature_transform_acts_on_row_vectors() -> None:
    network = PointNet().eval()
    inputs: list[Tensor] = []
    network.encoder.register_forward_pre_hook(lambda module, args: inputs.append(args[0]))
    swap_cycle = torch.eye(64).roll(1, dims=1)  # moves channel i to i + 1
    with torch.no_grad():
        network.feature_transform.output.bias.copy_((swap_cycle - torch.eye(64)).flatten())
        network(clouds())
        torch.testing.assert_close(inputs[0], network.local(clouds()).roll(1, dims=-1))


def test_penalty_by_hand() -> None:
    assert orthogonality_penalty(torch.eye(64).expand(3, -1, -1)) == 0
    assert orthogonality_penalty(torch.zeros(3, 64, 64)) == 3 * 32
    assert orthogonality_penalty(torch.tensor([[[0.0, 2.0], [1.0, 0.0]]])) == 0.5 * 3**2


def test_loss_is_cross_entropy_plus_the_summed_penalty_of_the_feature_transform() -> None:
    network = PointNet().eval()
    labels = torch.tensor([1, 2])
    loss, logits = network.training_loss(clouds(), labels)
    torch.testing.assert_close(loss, nn.functional.cross_entropy(logits, labels), rtol=0, atol=0)
    with torch.no_grad():
        network.feature_transform.output.bias.copy_(-torch.eye(64).flatten())  # A = 0
        network.input_transform.output.bias.fill_(1.0)  # is not regularised
    loss, logits = network.training_loss(clouds(), labels)
    expected = nn.functional.cross_entropy(logits, labels) + 0.001 * 2 * 32
    torch.testing.assert_close(loss, expected)


def test_order_of_points_does_not_matter() -> None:
    network = PointNet().eval()
    order = torch.randperm(128, generator=torch.Generator().manual_seed(1))
    torch.testing.assert_close(network(clouds()[:, order]), network(clouds()), rtol=0, atol=1e-6)


def test_coordinates_are_aligned_in_full_precision_under_autocast() -> None:
    network = PointNet().eval()
    inputs: list[Tensor] = []
    network.local.register_forward_pre_hook(lambda module, args: inputs.append(args[0]))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        network(clouds())
    assert torch.equal(inputs[0], clouds())
