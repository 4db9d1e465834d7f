# SPDX-License-Identifier: Apache-2.0
"""Dense layers: linear, batch normalisation, ReLU; and the heads that are built from them."""

from __future__ import annotations

from typing import cast

from torch import Tensor, nn

from doorstate.networks.layers.batch_norm import RowBatchNorm


def glorot(layer: nn.Linear) -> nn.Linear:
    """Initialise a linear layer with Glorot-uniform weights and a zero bias, as in the TensorFlow originals."""
    nn.init.xavier_uniform_(layer.weight)
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer


class Dense(nn.Sequential):
    """Linear layer, batch normalisation, ReLU; the linear layer keeps its bias, as in the originals."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__(glorot(nn.Linear(in_channels, out_channels)), RowBatchNorm(out_channels), nn.ReLU())

    def forward(self, rows: Tensor) -> Tensor:
        linear, norm = cast(nn.Linear, self[0]), cast(RowBatchNorm, self[1])
        return norm.after_linear(linear, rows).relu_()


def classification_head(in_channels: int, num_classes: int, dropout: float) -> nn.Sequential:
    """Build two dense layers of 512 and 256 channels with dropout, then logits."""
    return nn.Sequential(
        Dense(in_channels, 512),
        nn.Dropout(dropout),
        Dense(512, 256),
        nn.Dropout(dropout),
        glorot(nn.Linear(256, num_classes)),
    )


class JoinedDense(nn.Module):
    """Dense layer on [features of a point; features of its cloud].

    W [x; f] = W_x x + W_f f, so the second product is computed once per cloud.
    """

    def __init__(self, num_features: int, cloud_features: int, out_channels: int) -> None:
        super().__init__()
        self.own = glorot(nn.Linear(num_features, out_channels, bias=False))
        self.cloud = glorot(nn.Linear(cloud_features, out_channels, bias=False))
        self.norm = RowBatchNorm(out_channels)

    def forward(self, rows: Tensor, features: Tensor) -> Tensor:
        """Return (B, N, out_channels) of (B, N, C) points and (B, F) features of their clouds."""
        joined: Tensor = self.norm(self.own(rows) + self.cloud(features).unsqueeze(1))
        return joined.relu_()


class PointHead(nn.Module):
    """Classification of every point by its own features and those of its cloud."""

    def __init__(self, num_features: int, cloud_features: int, num_classes: int) -> None:
        super().__init__()
        self.joined = JoinedDense(num_features, cloud_features, 256)
        self.rest = nn.Sequential(Dense(256, 128), glorot(nn.Linear(128, num_classes)))

    def forward(self, rows: Tensor, features: Tensor) -> Tensor:
        """Return (B, N, num_classes) logits of (B, N, C) points and (B, F) features of their clouds."""
        logits: Tensor = self.rest(self.joined(rows, features))
        return logits
