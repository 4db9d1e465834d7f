# SPDX-License-Identifier: Apache-2.0
"""PointCNN: convolution after a learned reordering of each neighbourhood.

Li et al., 2018, arXiv:1801.07791, algorithm 1 and the authors' `modelnet_x3_l4`. Every layer is linear, then ELU, then
batch normalisation, without bias except the logits'.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.gather import first_rows, gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.networks.kernels.precision import at_least_float32, full_precision
from doorstate.networks.kernels.separable import separable
from doorstate.networks.layers.batch_norm import RowBatchNorm, set_batchnorm
from doorstate.networks.layers.point_mlp import PointLinear


class Level(NamedTuple):
    """Settings of one X-Conv."""

    k: int
    dilation: int
    num_representatives: int | None  # None: every point
    channels: int


_LEVELS = ((8, 48), (12, 96), (16, 192), (16, 384))  # K and channels of the original
_DEFAULT_DILATIONS = (1, 2, 2, 3)
_DEFAULT_REPRESENTATIVES = (None, 384, 128, 128)


class XTransform(nn.Module):
    """Prediction of the X matrix of each neighbourhood from its coordinates."""

    def __init__(self, k: int) -> None:
        super().__init__()
        self.k = k
        self.linear = nn.Linear(3 * k, k * k, bias=False)
        nn.init.normal_(self.linear.weight, std=sqrt(2 / (3 * k + k**3)))  # fans of a (1, K) kernel
        self.depthwise1 = _depthwise_weight(k, k, k)
        self.depthwise2 = _depthwise_weight(k, k, k)
        self.norm0, self.norm1, self.norm2 = (RowBatchNorm(k * k) for _ in range(3))

    def forward(self, offsets: Tensor) -> Tensor:
        """Return (B, P, K, K) matrices of (B, P, K, 3) coordinates relative to the representative point."""
        square = (*offsets.shape[:2], self.k, self.k)
        with full_precision(offsets):
            x = self.linear(offsets.flatten(2))  # (B, P, K * K)
        x = self.norm0(functional.elu(x)).view(square)  # (B, P, K, K)
        # A depthwise step contracts one axis and puts a new one last: the two contract different axes.
        x = self.norm1(functional.elu(_depthwise(x, self.depthwise1).flatten(2))).view(square)
        matrices: Tensor = self.norm2(_depthwise(x, self.depthwise2).flatten(2)).view(square)
        return matrices


class XConv(nn.Module):
    """X-Conv operator (algorithm 1): from points with features to representative points with features."""

    def __init__(self, level: Level, num_features: int, with_global: bool = False) -> None:
        super().__init__()
        self.k, self.dilation, self.num_representatives, channels = level
        self.all_representatives = self.num_representatives
        lifted = num_features // 4 if num_features else channels // 2
        multiplier = -(-channels // num_features) if num_features else 4
        self.lift = nn.Sequential(
            _elu_dense(PointLinear(0, lifted, bias=False)), _elu_dense(nn.Linear(lifted, lifted, bias=False))
        )
        self.transform = XTransform(self.k)
        self.depthwise = _depthwise_weight(self.k, lifted + num_features, multiplier)
        self.pointwise = _elu_dense(nn.Linear((lifted + num_features) * multiplier, channels, bias=False))
        self.position: nn.Module | None = None
        self.out_channels = channels
        if with_global:
            quarter = channels // 4
            self.position = nn.Sequential(
                _elu_dense(PointLinear(0, quarter, bias=False)),
                _elu_dense(nn.Linear(quarter, quarter, bias=False)),
            )
            self.out_channels += quarter

    def representatives(self, points: Tensor) -> Tensor:
        """Return the (B, P, 3) representative points of (B, N, 3) points."""
        return points if self.num_representatives is None else first_rows(points, self.num_representatives)

    def neighbours(self, points: Tensor) -> Tensor:
        """Return (B, P, K): every D-th of the nearest points of each representative, itself first."""
        # Deviation: with fewer than K * D points the dilation shrinks, so that K neighbours remain.
        count = points.shape[1]
        dilation = self.dilation if count >= self.k * self.dilation else count // self.k
        representatives = self.representatives(points)
        return knn(representatives, points, self.k * dilation)[..., ::dilation]

    def forward(self, points: Tensor, features: Tensor | None, indices: Tensor) -> tuple[Tensor, Tensor]:
        """Return the representatives (B, P, 3) and their features (B, P, out_channels).

        Args:
            points: (B, N, 3).
            features: (B, N, F), None in the first level.
            indices: (B, P, K) as `neighbours` returns them.
        """
        # Deviation: the first points in farthest-point order, not the first of a random permutation.
        representatives = self.representatives(points)  # (B, P, 3)
        offsets = gather_rows(points, indices) - representatives.unsqueeze(2)  # (B, P, K, 3)
        rows = self.lift(offsets)  # (B, P, K, C_lift)
        if features is not None:
            rows = torch.cat([rows, gather_rows(features, indices)], dim=-1)  # (B, P, K, C_lift + F)
        rows = self.transform(offsets) @ rows  # (B, P, K, C_lift + F)
        linear, activation, norm = self.pointwise
        out = separable(rows, self.depthwise, cast(nn.Linear, linear).weight)  # (B, P, channels)
        out = norm(activation(out))
        if self.position is not None:
            out = torch.cat([self.position(representatives), out], dim=-1)  # (B, P, channels / 4 + channels)
        return representatives, out


class PointCNN(PointNetwork):
    """PointCNN `x3_l4` on coordinates.

    The representative points of the last level are classified one by one in training; their features are averaged for
    one result per cloud.

    Args:
        num_classes: number of logits.
        dilations: D of the four levels.
        num_representatives: P of the four levels, None for every point.
        batchnorm_eps: epsilon of every batch normalisation; 1e-3 in the original.
    """

    feature_size = 192

    def __init__(
        self,
        num_classes: int = 3,
        *,
        dilations: tuple[int, int, int, int] = _DEFAULT_DILATIONS,
        num_representatives: tuple[int | None, int | None, int | None, int | None] = _DEFAULT_REPRESENTATIVES,
        batchnorm_eps: float = 1e-5,
    ) -> None:
        super().__init__()
        self.levels = nn.ModuleList()
        num_features = 0
        for (k, channels), dilation, count in zip(_LEVELS, dilations, num_representatives, strict=True):
            conv = XConv(Level(k, dilation, count, channels), num_features, with_global=len(self.levels) == 3)
            self.levels.append(conv)
            num_features = conv.out_channels
        self.dense = nn.Sequential(
            _elu_dense(nn.Linear(num_features, 384, bias=False)),
            _elu_dense(nn.Linear(384, self.feature_size, bias=False)),
            nn.Dropout(0.8),
        )
        self.head = nn.Linear(self.feature_size, num_classes)
        nn.init.xavier_normal_(self.head.weight)
        nn.init.zeros_(self.head.bias)
        set_batchnorm(self, eps=batchnorm_eps)

    def use_centres(self, share: float) -> None:
        for level in self._convs():
            if level.all_representatives is not None:
                level.num_representatives = max(level.k, round(share * level.all_representatives))

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Return the (B, P, K) neighbours of the representative points of each level."""
        neighbours = []
        for level in self._convs():
            neighbours.append(level.neighbours(points))
            points = level.representatives(points)
        return tuple(neighbours)

    def point_features(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Tensor:
        """Return the (B, P, 192) features of the representative points of the last level."""
        features = None
        neighbours = neighbourhoods or self.neighbourhoods(points)
        for level, indices in zip(self.levels, neighbours, strict=True):
            # (B, N, 48), (B, 384, 96), (B, 128, 192), (B, 128, 480)
            points, features = level(points, features, indices)
        rows: Tensor = self.dense(features)  # (B, 128, 192)
        return rows

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Encode (B, N, 3) points; the features are the mean of `point_features`, which are the intermediate tensor."""
        rows = self.point_features(points, neighbourhoods)  # (B, P, 192)
        features = at_least_float32(rows).mean(dim=1)  # (B, 192)
        return Encoding(features, (rows,))

    def loss_from_encoding(
        self, encoding: Encoding, labels: Tensor, label_smoothing: float
    ) -> tuple[Tensor, Tensor]:
        """Return the mean cross entropy of all representative points, and the mean of their logits."""
        (rows,) = encoding.intermediate
        logits = at_least_float32(self.head(rows))  # (B, P, C)
        tiled = labels.unsqueeze(1).expand(logits.shape[:2])  # (B, P)
        loss = functional.cross_entropy(
            logits.flatten(0, 1), tiled.flatten(), label_smoothing=label_smoothing
        )
        return loss, logits.mean(dim=1)

    def _convs(self) -> list[XConv]:
        return [cast(XConv, level) for level in self.levels]


def _elu_dense(linear: nn.Linear) -> nn.Sequential:
    nn.init.xavier_normal_(linear.weight)
    return nn.Sequential(linear, nn.ELU(), RowBatchNorm(linear.out_features))


def _depthwise(rows: Tensor, weight: Tensor) -> Tensor:
    """Contract one axis of each matrix: (B, P, K, C) with weight (K, C, m) to (B, P, C, m)."""
    return torch.einsum("bpkc,kcm->bpcm", rows, weight)


def _depthwise_weight(k: int, channels: int, multiplier: int) -> nn.Parameter:
    std = sqrt(2 / (k * channels + k * multiplier))  # Glorot-normal, fans counted as TensorFlow does
    return nn.Parameter(torch.randn(k, channels, multiplier) * std)
