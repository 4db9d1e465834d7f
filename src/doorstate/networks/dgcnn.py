# SPDX-License-Identifier: Apache-2.0
"""DGCNN: edge convolutions on a graph that is rebuilt in feature space.

Wang et al., 2019, arXiv:1801.07829, figure 3; without spatial transformer, as in the authors' PyTorch code.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.edge_conv import edge_max, edge_moments
from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.knn import knn
from doorstate.networks.kernels.max_over_points import max_over_points
from doorstate.networks.kernels.precision import full_precision
from doorstate.networks.kernels.spatial_order import spatial_order
from doorstate.networks.layers.batch_norm import RowBatchNorm, set_batchnorm
from doorstate.networks.layers.dense import PointHead

_SLOPE = 0.2


class EdgeConv(nn.Module):
    """Edge convolution: max over neighbours j of LeakyReLU(BatchNorm(W [x_j - x_i; x_i]))."""

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(2 * in_channels, out_channels, bias=False)
        self.norm = RowBatchNorm(out_channels)

    def forward(self, features: Tensor, indices: Tensor) -> Tensor:
        """Return (B, N, C_out) of (B, N, C) features and (B, N, k) neighbours."""
        moments = edge_moments(features, indices) if self.training else None
        weight, bias = self.norm.fold(self.linear, moments, count=indices.numel())
        # LeakyReLU is monotone and follows the maximum.
        return functional.leaky_relu(edge_max(features, indices, weight, bias), _SLOPE)


class DGCNN(PointNetwork):
    """DGCNN with four edge convolutions, maximum and mean pooling.

    Args:
        num_classes: number of logits.
        k: neighbours per point, the point itself included; None takes the authors' 20, and 40 from 2048 points on.
        batchnorm_eps: epsilon of every batch normalisation.
    """

    feature_size = 2048
    has_point_features = True

    def __init__(self, num_classes: int = 3, *, k: int | None = None, batchnorm_eps: float = 1e-5) -> None:
        super().__init__()
        self.k = k
        self.convs = nn.ModuleList([EdgeConv(3, 64), EdgeConv(64, 64), EdgeConv(64, 128), EdgeConv(128, 256)])
        self.aggregate = nn.Sequential(
            nn.Linear(512, 1024, bias=False), RowBatchNorm(1024), nn.LeakyReLU(_SLOPE)
        )
        self.head = nn.Sequential(
            nn.Linear(2048, 512, bias=False),
            RowBatchNorm(512),
            nn.LeakyReLU(_SLOPE),
            nn.Dropout(0.5),
            nn.Linear(512, 256),
            RowBatchNorm(256),
            nn.LeakyReLU(_SLOPE),
            nn.Dropout(0.5),
            nn.Linear(256, num_classes),
        )
        set_batchnorm(self, eps=batchnorm_eps)

    def num_neighbours(self, num_points: int) -> int:
        """Return the number of neighbours per point in a cloud of `num_points`."""
        if self.k is not None:
            return self.k
        if torch.compiler.is_exporting():  # one graph for both
            return cast(int, torch.sym_min(40, 20 + num_points // 2048 * 20))  # type: ignore[no-untyped-call]
        return 20 if num_points < 2048 else 40

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Return the (B, N) spatial order of the points, and (B, N, k) neighbours in that order."""
        order = spatial_order(points)
        points = gather_rows(points, order)
        return order, knn(points, points, self.num_neighbours(points.shape[1]), in_order=True)

    def edge_features(self, points: Tensor, neighbours: Tensor) -> list[Tensor]:
        """Return the outputs of the four edge convolutions: (B, N, 64), (B, N, 64), (B, N, 128), (B, N, 256).

        In full precision: the factored product subtracts numbers that bfloat16 could not tell apart.

        Args:
            points: (B, N, 3) in spatial order.
            neighbours: (B, N, k) of these points.
        """
        outputs: list[Tensor] = []
        features = points
        with full_precision(points):
            for conv in self.convs:
                if outputs:
                    neighbours = knn(features, features, neighbours.shape[2], in_order=True)  # (B, N, k)
                features = conv(features, neighbours)  # (B, N, C)
                outputs.append(features)
        return outputs

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Encode (B, N, 3) points.

        Intermediate: (B, N) spatial order, and (B, N, 512) outputs of the edge convolutions in that order.
        """
        order, neighbours = neighbourhoods or self.neighbourhoods(points)  # (B, N), (B, N, k)
        edges = torch.cat(self.edge_features(gather_rows(points, order), neighbours), dim=-1)  # (B, N, 512)
        linear, norm = cast(nn.Linear, self.aggregate[0]), cast(RowBatchNorm, self.aggregate[1])
        rows = functional.leaky_relu_(norm.after_linear(linear, edges), _SLOPE)  # (B, N, 1024)
        features = torch.cat([max_over_points(rows), rows.mean(dim=1)], dim=-1)  # (B, 2048)
        return Encoding(features, (order, edges))

    def part_branch(self, num_parts: int) -> nn.Module:
        return PartBranch(num_parts)


class PartBranch(nn.Module):
    """Segmentation of the paper: edge features of the points beside the features of the cloud.

    Deviation: two hidden layers in place of three.
    """

    def __init__(self, num_parts: int) -> None:
        super().__init__()
        self.head = PointHead(512, 2048, num_parts)

    def forward(self, points: Tensor, encoding: Encoding) -> Tensor:
        """Return (B, n, num_parts) logits of the first n points of the encoded clouds."""
        order, edges = encoding.intermediate
        rank = order.argsort(dim=1)[:, : points.shape[1]]  # (B, n), place of each point in the spatial order
        logits: Tensor = self.head(gather_rows(edges, rank), encoding.features)
        return logits
