# SPDX-License-Identifier: Apache-2.0
"""PointCNN: X-Conv against 2D convolutions, its table, its loss over representative points."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from doorstate.networks.kernels.knn import knn
from doorstate.networks.pointcnn import Level, PointCNN, XConv
from tests.networks import plain


def clouds(batch: int = 2, num_points: int = 128) -> Tensor:
    return torch.rand(batch, num_points, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("num_features", [0, 8])
def test_x_conv_equals_its_plain_twin(dtype: torch.dtype, num_features: int) -> None:
    module = XConv(Level(k=4, dilation=2, num_representatives=9, channels=12), num_features)
    points = clouds(num_points=20)
    features = torch.randn(2, 20, num_features, generator=torch.Generator().manual_seed(1))
    indices = module.neighbours(points)

    def fast(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        return module(leaves[0], leaves[1] if num_features else None, indices)[1]

    def literal(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        return plain.x_conv(leaves[0], leaves[1] if num_features else None, indices, module)

    plain.assert_twins(module, fast, literal, [points, features] if num_features else [points], dtype)


def test_shapes_of_neighbours_matrices_and_features() -> None:
    network = PointCNN().eval()
    matrices: list[torch.Size] = []
    neighbours: list[torch.Size] = []
    channels: list[int] = []
    centres: list[Tensor] = []
    points, features = clouds(1, 1024), None
    for level in network.levels:
        level.transform.register_forward_hook(lambda module, args, out: matrices.append(out.shape))
        indices = level.neighbours(points)
        neighbours.append(indices.shape)
        points, features = level(points, features, indices)
        channels.append(features.shape[-1])
        centres.append(points)
    assert neighbours == [(1, 1024, 8), (1, 384, 12), (1, 128, 16), (1, 128, 16)]
    assert matrices == [(1, 1024, 8, 8), (1, 384, 12, 12), (1, 128, 16, 16), (1, 128, 16, 16)]
    assert channels == [48, 96, 192, 480]
    assert torch.equal(centres[2], centres[3])
    assert torch.equal(centres[3], clouds(1, 1024)[:, :128])


def test_matrices_are_predicted_from_exact_coordinates_under_autocast() -> None:
    transform = PointCNN().levels[0].transform
    inputs: list[Tensor] = []
    transform.norm0.register_forward_pre_hook(lambda module, args: inputs.append(args[0]))
    offsets = torch.randn(1, 20, 8, 3)
    transform(offsets)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        transform(offsets)
    assert torch.equal(inputs[0], inputs[1])


def test_lift_widths_and_multipliers() -> None:
    levels = PointCNN().levels
    assert [level.lift[0][0].out_features for level in levels] == [24, 12, 24, 48]
    assert [tuple(level.depthwise.shape) for level in levels] == [
        (8, 24, 4),
        (12, 60, 2),
        (16, 120, 2),
        (16, 240, 2),
    ]


def test_dilated_neighbours_are_every_dth_of_the_nearest() -> None:
    points = clouds()
    level = XConv(Level(k=16, dilation=3, num_representatives=40, channels=32), 8)
    neighbours = level.neighbours(points)
    assert torch.equal(neighbours, knn(points[:, :40], points, 48)[..., ::3])
    assert (neighbours[..., 0] == torch.arange(40)).all()


def test_dilation_shrinks_when_points_are_few() -> None:
    points = clouds(num_points=40)
    level = XConv(Level(k=16, dilation=8, num_representatives=None, channels=32), 8)
    assert torch.equal(level.neighbours(points), knn(points, points, 32)[..., ::2])


def test_only_the_logits_have_a_bias() -> None:
    with_bias = [n for n, m in PointCNN().named_modules() if isinstance(m, nn.Linear) and m.bias is not None]
    assert with_bias == ["head"]


def test_global_branch_sees_where_the_representatives_are() -> None:
    level = PointCNN().double().eval().levels[3]
    points = clouds().double()
    features = torch.randn(2, 128, 192, generator=torch.Generator().manual_seed(1)).double()
    indices = level.neighbours(points)
    here, there = (level(points + shift, features, indices)[1] for shift in (0, 1))
    torch.testing.assert_close(here[..., 96:], there[..., 96:])
    assert (here[..., :96] - there[..., :96]).abs().max() > 0.1


def test_loss_is_the_mean_over_representative_points() -> None:
    network = PointCNN().eval()  # without dropout
    labels = torch.tensor([2, 0])
    loss, logits = network.training_loss(clouds(), labels, label_smoothing=0.1)
    point_logits = network.head(network.point_features(clouds()))
    assert point_logits.shape == (2, 128, 3)
    losses = [
        nn.functional.cross_entropy(point_logits[:, p], labels, label_smoothing=0.1) for p in range(128)
    ]
    torch.testing.assert_close(loss, torch.stack(losses).mean())
    torch.testing.assert_close(logits, network(clouds()))


def test_dropout_is_drawn_for_every_representative_point() -> None:
    network = PointCNN()
    dropout = network.dense[-1]
    assert dropout.p == 0.8
    kept = network.point_features(clouds()) != 0
    assert kept.float().mean() == pytest.approx(0.2, abs=0.02)
    assert not torch.equal(kept[:, 0], kept[:, 1])


def test_representatives_are_a_prefix_so_only_its_order_matters() -> None:
    network = PointCNN().double().eval()
    points = clouds(1, 500).double()
    generator = torch.Generator().manual_seed(1)
    tail = torch.cat([torch.arange(384), 384 + torch.randperm(116, generator=generator)])
    everything = torch.randperm(500, generator=generator)
    with torch.no_grad():
        torch.testing.assert_close(network(points[:, tail]), network(points), rtol=0, atol=1e-9)
        assert (network(points[:, everything]) - network(points)).abs().max() > 1e-3


def test_coarser_first_level() -> None:
    network = PointCNN(num_representatives=(256, 384, 128, 128), dilations=(4, 2, 2, 3)).eval()
    first, second, *_ = network.neighbourhoods(clouds(1, 600))
    points, features = network.levels[0](clouds(1, 600), None, first)
    assert points.shape == (1, 256, 3)
    points, _ = network.levels[1](points, features, second)
    assert points.shape == (1, 256, 3)  # no more points than there are
    assert network(clouds(1, 600)).shape == (1, 3)
