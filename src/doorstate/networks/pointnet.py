# SPDX-License-Identifier: Apache-2.0
"""PointNet: shared dense layers, two learned alignments, one maximum.

Qi et al., 2017, arXiv:1612.00593, figure 2.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.precision import at_least_float32, full_precision
from doorstate.networks.layers.batch_norm import set_batchnorm
from doorstate.networks.layers.dense import Dense, PointHead, classification_head
from doorstate.networks.layers.point_mlp import DenseMax, PointMLP


class TransformNet(nn.Module):
    """T-Net: a small PointNet that predicts a square matrix per cloud; the identity before training."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size
        self.trunk = PointMLP(0, (64, 128)) if size == 3 else nn.Sequential(Dense(size, 64), Dense(64, 128))
        self.pool = DenseMax(128, 1024)
        self.dense = nn.Sequential(Dense(1024, 512), Dense(512, 256))
        self.output = nn.Linear(256, size * size)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(self, rows: Tensor) -> Tensor:
        """Return the (B, size, size) transform, in full precision, of (B, N, size) rows."""
        rows = self.trunk(rows)  # (B, N, 128)
        code = self.pool(rows)  # (B, 1024)
        code = at_least_float32(self.dense(code))  # (B, 256)
        with full_precision(code):
            residual = self.output(code).view(-1, self.size, self.size)  # (B, size, size)
        transform: Tensor = residual + torch.eye(self.size, dtype=residual.dtype, device=residual.device)
        return transform


class PointNet(PointNetwork):
    """PointNet with input and feature transform.

    Args:
        num_classes: number of logits.
        regularizer_weight: weight of the feature transform's distance from an orthogonal matrix in the loss.
        batchnorm_eps: epsilon of every batch normalisation; 1e-3 in the original.
    """

    feature_size = 1024
    has_point_features = True

    def __init__(
        self, num_classes: int = 3, *, regularizer_weight: float = 0.001, batchnorm_eps: float = 1e-5
    ) -> None:
        super().__init__()
        self.regularizer_weight = regularizer_weight
        self.input_transform = TransformNet(3)
        self.local = PointMLP(0, (64, 64))
        self.feature_transform = TransformNet(64)
        self.encoder = nn.Sequential(Dense(64, 64), Dense(64, 128), DenseMax(128, 1024))
        self.head = classification_head(self.feature_size, num_classes, dropout=0.3)
        set_batchnorm(self, eps=batchnorm_eps)

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Encode (B, N, 3) points; intermediate: (B, 64, 64) feature transform and (B, N, 64) rows."""
        rotation = self.input_transform(points)  # (B, 3, 3)
        with full_precision(points):
            aligned = points @ rotation  # (B, N, 3)
        rows = self.local(aligned)  # (B, N, 64)
        transform = self.feature_transform(rows)  # (B, 64, 64)
        rows = rows @ transform  # (B, N, 64)
        features = self.encoder(rows)  # (B, 1024), the maximum over the points
        return Encoding(features, (transform, rows))

    def loss_from_encoding(
        self, encoding: Encoding, labels: Tensor, label_smoothing: float
    ) -> tuple[Tensor, Tensor]:
        """Return cross entropy + weight/2 * sum over the batch of |A A^T - I|_F^2, A the feature transform.

        A sum, not a mean, as TensorFlow's l2_loss in the original: its weight grows with the batch.
        """
        loss, logits = super().loss_from_encoding(encoding, labels, label_smoothing)
        transform, _ = encoding.intermediate
        # The mean over ranks is a part of the sum.
        weight = self.regularizer_weight * self.num_ranks
        return loss + weight * orthogonality_penalty(transform), logits

    def part_branch(self, num_parts: int) -> nn.Module:
        return PartBranch(num_parts)


def orthogonality_penalty(transform: Tensor) -> Tensor:
    """Return half the sum over the batch of |A A^T - I|_F^2 of (B, K, K) matrices, in full precision."""
    with full_precision(transform):
        identity = torch.eye(transform.shape[-1], dtype=transform.dtype, device=transform.device)
        return 0.5 * (transform @ transform.mT - identity).square().sum()


class PartBranch(nn.Module):
    """Segmentation of the paper: rows of the points beside the features of the cloud.

    Deviation: 256 and 128 channels in place of 512, 256 and 128.
    """

    def __init__(self, num_parts: int) -> None:
        super().__init__()
        self.head = PointHead(64, 1024, num_parts)

    def forward(self, points: Tensor, encoding: Encoding) -> Tensor:
        """Return (B, n, num_parts) logits of the first n points of the encoded clouds."""
        _, rows = encoding.intermediate
        logits: Tensor = self.head(rows[:, : points.shape[1]], encoding.features)
        return logits
