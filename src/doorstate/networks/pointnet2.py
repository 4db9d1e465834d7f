# SPDX-License-Identifier: Apache-2.0
"""PointNet++: small PointNets on balls around ever fewer centres.

Qi et al., 2017, arXiv:1706.02413, figure 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn

from doorstate.errors import ConfigError, unknown_name
from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.ball_query import ball_query
from doorstate.networks.kernels.gather import first_rows, gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.networks.kernels.precision import full_precision
from doorstate.networks.layers.ball_pooling import pool_balls
from doorstate.networks.layers.batch_norm import RowBatchNorm, set_batchnorm
from doorstate.networks.layers.dense import Dense, classification_head, glorot
from doorstate.networks.layers.point_mlp import PooledMLP


class Scale(NamedTuple):
    """Ball size of a level."""

    relative_radius: float  # to the radius of the level
    num_samples: int  # points per ball
    channels: tuple[int, ...]  # of the shared layers


class Variant(NamedTuple):
    """The two levels with balls, and the dropout rate of the head."""

    levels: tuple[tuple[Scale, ...], tuple[Scale, ...]]
    dropout: float


VARIANTS = {
    "ssg": Variant(((Scale(1, 32, (64, 64, 128)),), (Scale(1, 64, (128, 128, 256)),)), dropout=0.5),
    "msg": Variant(
        (
            (Scale(0.5, 16, (32, 32, 64)), Scale(1, 32, (64, 64, 128)), Scale(2, 128, (64, 96, 128))),
            (Scale(0.5, 32, (64, 64, 128)), Scale(1, 64, (128, 128, 256)), Scale(2, 128, (128, 128, 256))),
        ),
        dropout=0.6,
    ),
}


class SetAbstraction(nn.Module):
    """Level of the network: centres, and a PointNet on the ball around each, one ball per scale.

    Args:
        num_centres: the first points of the cloud serve as centres, all points if there are fewer.
        radius: ball radius of a scale with relative radius 1.
        scales: sizes and widths; the features of the scales are concatenated.
        num_features: channels of the points' features.
    """

    def __init__(self, num_centres: int, radius: float, scales: Sequence[Scale], num_features: int) -> None:
        super().__init__()
        self.all_centres = self.num_centres = num_centres
        self.balls = [(radius * scale.relative_radius, scale.num_samples) for scale in scales]
        self.mlps = nn.ModuleList([PooledMLP(num_features, scale.channels) for scale in scales])
        self.out_channels = sum(scale.channels[-1] for scale in scales)

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Return the (B, M, K) points in the balls around the centres, one tensor per scale."""
        return tuple(ball_query(first_rows(points, self.num_centres), points, *ball) for ball in self.balls)

    def forward(
        self, points: Tensor, features: Tensor | None, neighbourhoods: Neighbourhoods
    ) -> tuple[Tensor, Tensor]:
        """Return (B, M, 3) centres and (B, M, out_channels) features of (B, N, 3) points and (B, N, F) features."""
        centres = first_rows(points, self.num_centres)  # (B, M, 3)
        pooled = []
        for indices, mlp in zip(neighbourhoods, self.mlps, strict=True):
            if torch.compiler.is_exporting():
                pooled.append(pool_balls(cast(PooledMLP, mlp), points, centres, features, indices))
                continue
            offsets = gather_rows(points, indices) - centres.unsqueeze(2)  # (B, M, K, 3)
            pooled.append(mlp(offsets, features, indices))  # (B, M, C)
        return centres, torch.cat(pooled, dim=-1)


class PointNet2(PointNetwork):
    """PointNet++ for classification, with single-scale ("ssg") or multi-scale ("msg") grouping.

    Args:
        num_classes: number of logits.
        variant: "ssg" or "msg".
        radii: ball radius of the two levels, in the unit of the points; "msg" adds half and twice of each.
        num_samples: points per ball of every scale instead of the variant's own numbers.
        centres: number of centres of the two levels; time grows with them, the number of parameters does not.
        batchnorm_eps: epsilon of every batch normalisation; 1e-3 in the original.

    Raises:
        ConfigError: unknown variant, or not two numbers of centres.
    """

    feature_size = 1024
    has_point_features = True
    neighbours_are_scale_invariant = False  # a ball keeps its radius

    def __init__(
        self,
        num_classes: int = 3,
        *,
        variant: str = "ssg",
        radii: tuple[float, float] = (0.2, 0.4),
        num_samples: int | None = None,
        centres: tuple[int, int] = (512, 128),
        batchnorm_eps: float = 1e-5,
    ) -> None:
        super().__init__()
        if variant not in VARIANTS:
            raise unknown_name("pointnet2 variant", variant, VARIANTS)
        if len(centres) != len(radii) or min(centres) < 1:
            raise ConfigError(
                f"cannot use {centres}", field="centres", expected="two whole numbers of at least 1"
            )
        levels, dropout = VARIANTS[variant]
        first, second = (
            [scale._replace(num_samples=num_samples or scale.num_samples) for scale in level]
            for level in levels
        )
        self.level1 = SetAbstraction(centres[0], radii[0], first, num_features=0)
        self.level2 = SetAbstraction(centres[1], radii[1], second, self.level1.out_channels)
        self.level3 = PooledMLP(self.level2.out_channels, (256, 512, 1024))
        self.head = classification_head(self.feature_size, num_classes, dropout)
        set_batchnorm(self, eps=batchnorm_eps)

    def use_centres(self, share: float) -> None:
        for level in (self.level1, self.level2):
            level.num_centres = max(1, round(share * level.all_centres))

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Return the balls of the first level's scales, then of the second's."""
        centres = first_rows(points, self.level1.num_centres)
        return self.level1.neighbourhoods(points) + self.level2.neighbourhoods(centres)

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Encode (B, N, 3) points; the third level sees absolute coordinates.

        Intermediate: (B, 512, 3) centres of the first level, (B, 512, C1) and (B, 128, C2) features of both levels.
        """
        balls = neighbourhoods or self.neighbourhoods(points)
        scales = len(self.level1.balls)
        centres1, features1 = self.level1(points, None, balls[:scales])  # (B, 512, 3), (B, 512, C1)
        centres2, features2 = self.level2(centres1, features1, balls[scales:])  # (B, 128, 3), (B, 128, C2)
        features = self.level3(centres2, features2)  # (B, 1024), the maximum over the centres
        return Encoding(features, (centres1, features1, features2))

    def part_branch(self, num_parts: int) -> nn.Module:
        return PartBranch(num_parts, self.level1.out_channels, self.level2.out_channels)


class PartBranch(nn.Module):
    """Segmentation of the paper: features are interpolated from centres to points, level by level.

    A linear layer commutes with the weighted mean of three centres, so it is applied before, to fewer rows.
    """

    def __init__(self, num_parts: int, channels1: int, channels2: int) -> None:
        super().__init__()
        self.second = nn.Sequential(Dense(channels2 + 1024, 256), glorot(nn.Linear(256, 256)))
        self.first = glorot(nn.Linear(channels1, 256))
        self.first_norm = RowBatchNorm(256)
        self.between = glorot(nn.Linear(256, 128))
        self.norm = RowBatchNorm(128)
        self.rest = nn.Sequential(nn.ReLU(), Dense(128, 128), glorot(nn.Linear(128, num_parts)))

    def forward(self, points: Tensor, encoding: Encoding) -> Tensor:
        """Return (B, n, num_parts) logits of the first n points of the encoded clouds."""
        centres1, features1, features2 = encoding.intermediate
        centres2 = centres1[:, : features2.shape[1]]  # (B, 128, 3)
        cloud = encoding.features.unsqueeze(1).expand(-1, features2.shape[1], -1)  # (B, 128, 1024)
        rows = self.second(torch.cat([features2, cloud], dim=-1))  # (B, 128, 256)
        rows = self.first(features1) + interpolate(rows, centres2, centres1)  # (B, 512, 256)
        rows = self.between(self.first_norm(rows).relu())  # (B, 512, 128)
        rows = self.norm(interpolate(rows, centres1, points))  # (B, n, 128)
        logits: Tensor = self.rest(rows)  # (B, n, num_parts)
        return logits


def interpolate(features: Tensor, centres: Tensor, points: Tensor) -> Tensor:
    """Return the mean of the features of the three centres nearest to each point, weighted by 1 / distance^2.

    Args:
        features: (B, M, C) of the centres.
        centres: (B, M, 3).
        points: (B, N, 3).

    Returns:
        (B, N, C).
    """
    nearest = knn(points, centres, 3)  # (B, N, 3)
    with full_precision(points):
        squares = (gather_rows(centres, nearest) - points.unsqueeze(2)).square().sum(dim=-1)  # (B, N, 3)
        weight = 1 / (squares + 1e-8)
        weight = weight / weight.sum(dim=-1, keepdim=True)
    mean: Tensor = (gather_rows(features, nearest) * weight.unsqueeze(-1).to(features.dtype)).sum(dim=2)
    return mean
