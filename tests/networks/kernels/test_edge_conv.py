# SPDX-License-Identifier: Apache-2.0
"""Edge convolution without edges: moments, maximum."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from doorstate.networks.kernels.edge_conv import edge_max, edge_moments
from tests.networks import plain
from tests.networks.twins import assert_same, random_indices, rows


def test_edge_max_equals_the_maximum_over_all_edges() -> None:
    indices = random_indices(2, 9, 9, 4)

    def literal(features: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        neighbours = plain.gather(features, indices)  # (B, N, k, C)
        centres = features.unsqueeze(2).expand_as(neighbours)
        edges = torch.cat([neighbours - centres, centres], dim=-1)
        return functional.linear(edges, weight, bias).max(2).values

    assert_same(
        lambda features, weight, bias: edge_max(features, indices, weight, bias),
        literal,
        rows(2, 9, 5),
        rows(7, 10, seed=1),
        rows(7, seed=2),
    )


def test_edge_moments_do_not_cancel_far_from_zero() -> None:
    features = torch.randn(2, 40, 3, generator=torch.Generator().manual_seed(0))
    indices = torch.randint(0, 40, (2, 40, 6), generator=torch.Generator().manual_seed(2))
    neighbours = plain.gather(features, indices).double()
    centres = features.double().unsqueeze(2).expand_as(neighbours)
    edges = torch.cat([neighbours - centres, centres], dim=-1).flatten(0, 2)
    mean, covariance = edge_moments(features + 100, indices)
    mean[3:] -= 100
    torch.testing.assert_close(mean.double(), edges.mean(0), rtol=0, atol=1e-4)
    torch.testing.assert_close(covariance.double(), edges.T.cov(correction=0), rtol=0, atol=1e-4)
