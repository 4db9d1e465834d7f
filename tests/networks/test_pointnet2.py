# SPDX-License-Identifier: Apache-2.0
"""PointNet++: set abstraction against its plain twin, both variants, invariances."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from torch import Tensor, nn

from doorstate.errors import ConfigError
from doorstate.networks.pointnet2 import VARIANTS, PointNet2, Scale, SetAbstraction, interpolate
from tests.networks import plain

SCALES = (Scale(0.5, 4, (6, 7, 8)), Scale(1, 8, (5, 6, 9)))


def clouds(batch: int = 2, num_points: int = 128, size: float = 1.0) -> Tensor:
    return (torch.rand(batch, num_points, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1) * size


def test_variants_as_published() -> None:
    assert [[s[1:] for s in level] for level in VARIANTS["ssg"].levels] == [
        [(32, (64, 64, 128))],
        [(64, (128, 128, 256))],
    ]
    network = PointNet2(variant="msg")
    assert network.level1.balls == [(0.1, 16), (0.2, 32), (0.4, 128)]
    assert network.level2.balls == [(0.2, 32), (0.4, 64), (0.8, 128)]
    assert [network.level1.out_channels, network.level2.out_channels] == [320, 640]
    for variant, rate in (("ssg", 0.5), ("msg", 0.6)):
        assert [m.p for m in PointNet2(variant=variant).modules() if isinstance(m, nn.Dropout)] == [
            rate,
            rate,
        ]


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("num_features", [0, 5])
def test_set_abstraction_equals_its_plain_twin(dtype: torch.dtype, num_features: int) -> None:
    points = clouds(num_points=40)
    features = torch.randn(2, 40, num_features, generator=torch.Generator().manual_seed(1))

    def fast(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        balls = module.neighbourhoods(leaves[0])
        centres, pooled = module(leaves[0], leaves[1] if num_features else None, balls)
        return torch.cat([centres, pooled], dim=-1)

    def literal(module: nn.Module, leaves: list[Tensor]) -> Tensor:
        centres = leaves[0][:, :10]
        out = [centres]
        for (radius, num_samples), mlp in zip(module.balls, module.mlps, strict=True):
            indices = plain.ball_query(centres, leaves[0], radius, num_samples)
            offsets = plain.gather(leaves[0], indices) - centres.unsqueeze(2)
            rows = torch.cat([offsets, *(plain.gather(leaf, indices) for leaf in leaves[1:])], dim=-1)
            out.append(plain.pooled_mlp(rows, mlp))
        return torch.cat(out, dim=-1)

    module = SetAbstraction(10, 0.8, SCALES, num_features)
    plain.assert_twins(module, fast, literal, [points, features] if num_features else [points], dtype)


@pytest.mark.parametrize(("variant", "channels"), [("ssg", (128, 256)), ("msg", (320, 640))])
def test_shapes_of_the_levels(variant: str, channels: tuple[int, int]) -> None:
    network = PointNet2(variant=variant).eval()
    balls = network.neighbourhoods(clouds(1, 600))
    first, second = balls[: len(balls) // 2], balls[len(balls) // 2 :]
    with torch.no_grad():
        centres, features = network.level1(clouds(1, 600), None, first)
        assert centres.shape == (1, 512, 3)
        assert features.shape == (1, 512, channels[0])
        centres, features = network.level2(centres, features, second)
        assert features.shape == (1, 128, channels[1])
        assert network.level3(centres, features).shape == (1, 1024)
    assert torch.equal(centres, clouds(1, 600)[:, :128])  # the prefix, in order


def test_fewer_centres_are_the_first_ones_with_the_same_weights() -> None:
    network, coarse = PointNet2().eval(), PointNet2(centres=(256, 64)).eval()
    coarse.load_state_dict(network.state_dict())
    network.use_centres(0.5)
    with torch.no_grad():
        assert torch.equal(coarse(clouds(1, 600)), network(clouds(1, 600)))


def test_multi_scale_grouping_trains() -> None:
    network = PointNet2(variant="msg", num_samples=8)
    assert {n for level in (network.level1, network.level2) for _, n in level.balls} == {8}
    loss, _ = network.training_loss(clouds(), torch.tensor([0, 1]))
    loss.backward()
    assert all(p.grad is not None and p.grad.isfinite().all() for p in network.parameters())


def test_radii_are_in_the_unit_of_the_points() -> None:
    unit, metric = (PointNet2(radii=radii).eval() for radii in ((0.2, 0.4), (0.6, 1.2)))
    metric.load_state_dict(unit.state_dict())
    with torch.no_grad():
        metric.level1.mlps[0].mlp.first.weight /= 3  # three input channels, all coordinates
        small, large = (
            network.level1(points, None, network.level1.neighbourhoods(points))[1]
            for network, points in ((unit, clouds()), (metric, clouds() * 3))
        )
    torch.testing.assert_close(small, large)


def test_a_shift_reaches_only_the_last_level() -> None:
    network = PointNet2().double().eval()
    points = clouds().double()
    moved = points + torch.tensor([0.5, -1.0, 2.0])
    here, there = (
        network.level1(cloud, None, network.level1.neighbourhoods(cloud))[1] for cloud in (points, moved)
    )
    torch.testing.assert_close(here, there)
    assert (network(points) - network(moved)).abs().max() > 1e-3


def test_order_after_the_centres_matters_only_to_full_balls() -> None:
    points = clouds(1, 700, size=2.0)
    tail = 512 + torch.randperm(188, generator=torch.Generator().manual_seed(1))
    shuffled = points[:, torch.cat([torch.arange(512), tail])]
    roomy, full = PointNet2().eval(), PointNet2(radii=(1.5, 3.0)).eval()
    full.load_state_dict(roomy.state_dict())
    with torch.no_grad():
        torch.testing.assert_close(roomy(points), roomy(shuffled), rtol=0, atol=1e-6)
        assert (full(points) - full(shuffled)).abs().max() > 1e-6


def test_an_unknown_variant_is_refused() -> None:
    with pytest.raises(ConfigError, match="unknown pointnet2 variant 'mrg'"):
        PointNet2(variant="mrg")


def test_interpolation_equals_scipy() -> None:
    points, centres = torch.rand(3, 300, 3, dtype=torch.float64), torch.rand(3, 40, 3, dtype=torch.float64)
    features = torch.rand(3, 40, 5, dtype=torch.float64)
    interpolated = interpolate(features, centres, points)
    for cloud in range(3):
        distance, index = cKDTree(centres[cloud].numpy()).query(points[cloud].numpy(), 3)
        weight = 1 / (np.square(distance) + 1e-8)
        weight /= weight.sum(axis=1, keepdims=True)
        expected = (features[cloud].numpy()[index] * weight[..., None]).sum(axis=1)
        np.testing.assert_allclose(interpolated[cloud].numpy(), expected, atol=1e-9)
