# SPDX-License-Identifier: Apache-2.0
"""Point2Sequence: nested areas, the LSTM cell against torch's, attention written out."""

from __future__ import annotations

import copy

import pytest
import torch
from torch import Tensor, nn

from doorstate.errors import ConfigError
from doorstate.networks.kernels.knn import knn
from doorstate.networks.point2sequence import AREAS, Attention, LSTMCell, Point2Sequence


def clouds(batch: int = 2, num_points: int = 128) -> Tensor:
    return torch.rand(batch, num_points, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1


@pytest.fixture(scope="module")
def network() -> Point2Sequence:
    return Point2Sequence().eval()


@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-9), (torch.float32, 1e-4)])
def test_cell_equals_torch_lstm_with_one_bias(dtype: torch.dtype, tolerance: float) -> None:
    cell = LSTMCell(5, 7).to(dtype)
    nn.init.normal_(cell.linear.bias)
    oracle = nn.LSTM(5, 7, batch_first=True, dtype=dtype)
    with torch.no_grad():
        oracle.weight_ih_l0.copy_(cell.linear.weight[:, :5])
        oracle.weight_hh_l0.copy_(cell.linear.weight[:, 5:])
        oracle.bias_hh_l0.zero_()
        oracle.bias_ih_l0.copy_(cell.linear.bias)
        oracle.bias_ih_l0[7:14] += 1  # forget gate
    sequence = torch.randn(3, 4, 5, generator=torch.Generator().manual_seed(0)).to(dtype)
    state, hidden = None, []
    for step in sequence.unbind(1):
        state = cell(step, state)
        hidden.append(state[0])
    out = torch.stack(hidden, dim=1)
    expected, _ = oracle(sequence)
    torch.testing.assert_close(out, expected, rtol=tolerance, atol=tolerance)
    out.square().sum().backward()
    expected.square().sum().backward()
    gradients = torch.cat([oracle.weight_ih_l0.grad, oracle.weight_hh_l0.grad], dim=1)
    torch.testing.assert_close(cell.linear.weight.grad, gradients, rtol=tolerance, atol=tolerance)
    torch.testing.assert_close(cell.linear.bias.grad, oracle.bias_ih_l0.grad, rtol=tolerance, atol=tolerance)


def test_inputs_left_out_are_zeros() -> None:
    cell = LSTMCell(6, 4)
    inputs = torch.randn(3, 2, generator=torch.Generator().manual_seed(0))
    padded = torch.cat([inputs, torch.zeros(3, 4)], dim=-1)
    zeros = torch.zeros(3, 4)
    for short, full in zip(cell(inputs), cell(padded, (zeros, zeros)), strict=True):
        torch.testing.assert_close(short, full)


def test_attention_written_out() -> None:
    attention = Attention(6).double()
    memory = torch.randn(2, 3, 4, 6, generator=torch.Generator().manual_seed(0)).double()
    query = torch.randn(2, 3, 6, generator=torch.Generator().manual_seed(1)).double()
    weights = attention.weights(memory, query)
    assert weights.shape == (2, 3, 4)
    torch.testing.assert_close(weights.sum(-1), torch.ones(2, 3).double())
    for b in range(2):
        for m in range(3):
            h, d = memory[b, m], query[b, m]
            scores = torch.stack(
                [
                    attention.score.weight[0]
                    @ torch.tanh(attention.memory.weight @ h[t] + attention.query.weight @ d)
                    for t in range(4)
                ]
            )
            a = torch.exp(scores) / torch.exp(scores).sum()
            torch.testing.assert_close(weights[b, m], a)
            vector = attention.combine.weight @ torch.cat([d, sum(a[t] * h[t] for t in range(4))])
            torch.testing.assert_close(attention(memory, query)[b, m], vector)


def test_areas_are_nested_and_ordered(network: Point2Sequence) -> None:
    points = clouds(1, 500)
    neighbours = network.neighbourhoods(points)[0]
    assert neighbours.shape == (1, 384, 128)
    assert torch.equal(neighbours, knn(points[:, :384], points, 128))
    assert list(AREAS) == [16, 32, 64, 128]
    with torch.no_grad():
        sequence = network.sequence(points, *network.neighbourhoods(points))
        assert sequence.shape == (1, 384, 4, 128)
        for t, (size, mlp) in enumerate(zip(AREAS, network.mlps, strict=True)):
            offsets = points[0, neighbours[0, 5, :size]] - points[0, 5]  # one region by hand
            torch.testing.assert_close(sequence[0, 5, t], mlp(offsets[None])[0])


def test_sequence_is_read_from_small_to_large(network: Point2Sequence) -> None:
    sequence = torch.randn(1, 3, 4, 128, generator=torch.Generator().manual_seed(0))
    memory, query = network.encode_decode(sequence)
    assert memory.shape == (1, 3, 4, 128)
    assert query.shape == (1, 3, 128)
    changed = sequence.clone()
    changed[:, :, 3] += 1
    changed_memory, changed_query = network.encode_decode(changed)
    assert torch.equal(changed_memory[:, :, :3], memory[:, :, :3])
    assert not torch.equal(changed_memory[:, :, 3], memory[:, :, 3])
    assert not torch.equal(changed_query, query)


@pytest.mark.parametrize("region_feature", ["attention", "released"])
def test_attention_reaches_the_output_unless_as_released(region_feature: str) -> None:
    network = Point2Sequence(region_feature=region_feature)
    assert sum(p.numel() for p in network.attention.parameters()) == 65_664
    loss, _ = network.training_loss(clouds(), torch.tensor([0, 1]))
    loss.backward()
    reached = [p.grad is not None and bool(p.grad.any()) for p in network.attention.parameters()]
    assert reached == [region_feature == "attention"] * 4


@pytest.mark.parametrize("region_feature", ["attention", "released"])
def test_region_feature(region_feature: str) -> None:
    network = Point2Sequence(region_feature=region_feature).eval()
    points = clouds()
    memory, query = network.encode_decode(network.sequence(points, *network.neighbourhoods(points)))
    region = network.attention(memory, query) if region_feature == "attention" else query
    expected = network.globals(points, network.region(region))
    torch.testing.assert_close(network.features(points), expected)


def test_dilated_areas_shrink_when_points_are_few() -> None:
    network = Point2Sequence(dilation=4)
    many, few = clouds(1, 600), clouds(1, 300)
    assert torch.equal(network.neighbourhoods(many)[0], knn(many[:, :384], many, 512)[..., ::4])
    assert torch.equal(network.neighbourhoods(few)[0], knn(few, few, 256)[..., ::2])


def test_a_shift_reaches_only_the_last_level(network: Point2Sequence) -> None:
    network = copy.deepcopy(network).double()
    points = clouds().double()
    moved = points + torch.tensor([0.5, -1.0, 2.0])
    torch.testing.assert_close(
        network.sequence(points, *network.neighbourhoods(points)),
        network.sequence(moved, *network.neighbourhoods(moved)),
    )
    assert (network(points) - network(moved)).abs().max() > 1e-3


def test_order_after_the_centres_does_not_matter(network: Point2Sequence) -> None:
    points = clouds(1, 450)
    tail = 384 + torch.randperm(66, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        shuffled = network(points[:, torch.cat([torch.arange(384), tail])])
        torch.testing.assert_close(shuffled, network(points), rtol=0, atol=1e-6)


def test_head_drops_six_of_ten() -> None:
    assert [m.p for m in Point2Sequence().modules() if isinstance(m, nn.Dropout)] == [0.6, 0.6]


def test_an_unknown_region_feature_is_refused() -> None:
    with pytest.raises(ConfigError, match="unknown point2sequence region_feature 'paper'"):
        Point2Sequence(region_feature="paper")
