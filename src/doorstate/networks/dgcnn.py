# SPDX-License-Identifier: Apache-2.0
"""DGCNN: edge convolutions on a graph rebuilt in feature space (Wang et al., 2019, arXiv:1801.07829)."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.base import Encoding, Neighbourhoods, PointNetwork
from doorstate.networks.kernels.ops import (
    full_precision,
    gather_rows,
    max_over_points,
    neighbour_max,
    neighbour_sum,
)
from doorstate.networks.kernels.search import knn, spatial_order
from doorstate.networks.layers import PointHead, RowBatchNorm, set_batchnorm

_SLOPE = 0.2


class EdgeConv(nn.Module):
    """max over neighbours j of LeakyReLU(BatchNorm(W [x_j - x_i; x_i])), without building the edges' inputs.

    The batch's statistics are known from the edges' mean and covariance, so BatchNorm folds into W = [A, B], and
    W [x_j - x_i; x_i] = A x_j + (B - A) x_i: two products per point. LeakyReLU is monotone and follows the maximum.
    """

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(2 * in_channels, out_channels, bias=False)
        self.norm = RowBatchNorm(out_channels)

    def forward(self, features: Tensor, indices: Tensor) -> Tensor:
        """(B, N, C_out) of (B, N, C) features and (B, N, k) neighbours."""
        moments = edge_moments(features, indices) if self.training else None
        weight, bias = self.norm.fold(self.linear, moments, count=indices.numel())
        difference, own = weight.chunk(2, dim=1)
        neighbour = functional.linear(features, difference)  # (B, N, C_out): A x
        centre = functional.linear(features, own - difference, bias)  # (B, N, C_out): (B - A) x
        return functional.leaky_relu(neighbour_max(neighbour, indices) + centre, _SLOPE)


def edge_moments(features: Tensor, indices: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and covariance of [x_j - x_i; x_i] over all edges of all clouds, without the edges.

    Args:
        features: (B, N, C) x.
        indices: (B, N, k) neighbours j of each point i.

    Returns:
        (2C,) mean and (2C, 2C) covariance divided by the number of edges.
    """
    each = features.new_full((1,), 1 / indices.numel()).expand(len(indices), indices[0].numel())
    share = (
        features.new_zeros(indices.shape[:2]).scatter_add_(1, indices.flatten(1), each).view(-1, 1)
    )  # (B * N, 1) of all edges
    flat = features.flatten(0, 1)
    mean = flat.mean(0)
    flat = flat - mean  # centred, so that the squares do not cancel
    around = neighbour_sum(flat.view_as(features), indices).flatten(0, 1)  # (B * N, C): sum of x_j
    mean_end = (share * flat).sum(0)  # of x_j, where the mean of x_i is zero
    end_end = (share * flat).T @ flat
    end_own = around.T @ flat / indices.numel()
    own_own = flat.T @ flat / len(flat)
    step_own = end_own - own_own
    step_step = end_end - end_own - step_own.T - torch.outer(mean_end, mean_end)
    covariance = torch.cat([torch.cat([step_step, step_own], 1), torch.cat([step_own.T, own_own], 1)])
    return torch.cat([mean_end, mean]), covariance


class PartBranch(nn.Module):
    """The paper's segmentation: each point's edge features beside the cloud's; one layer fewer than its three."""

    def __init__(self, num_parts: int) -> None:
        super().__init__()
        self.head = PointHead(512, 2048, num_parts)

    def forward(self, points: Tensor, encoding: Encoding) -> Tensor:
        """(B, n, num_parts) logits of the first n points, those that are given."""
        order, edges = encoding.inner
        place = order.argsort(dim=1)[:, : points.shape[1]]
        logits: Tensor = self.head(gather_rows(edges, place), encoding.features)
        return logits


class DGCNN(PointNetwork):
    """DGCNN as in the authors' PyTorch code: no spatial transformer, LeakyReLU, maximum and mean pooling.

    Args:
        num_classes: number of logits.
        k: neighbours per point, itself included; None takes as many as the authors: 20, and 40 from 2048 points on.
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
        """How many neighbours each point has in a cloud of so many points."""
        return self.k or (20 if num_points < 2048 else 40)

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """(B, N) order in which near points follow each other, and (B, N, k) neighbours in that order."""
        order = spatial_order(points)
        points = gather_rows(points, order)
        return order, knn(points, points, self.num_neighbours(points.shape[1]), in_order=True)

    def edge_features(self, points: Tensor, neighbours: Tensor) -> list[Tensor]:
        """(B, N, 64), (B, N, 64), (B, N, 128) and (B, N, 256) outputs of the edge convolutions.

        In full precision: the factored product subtracts what bfloat16 could no longer tell apart.

        Args:
            points: (B, N, 3) in spatial order.
            neighbours: (B, N, k) of these points.
        """
        outputs: list[Tensor] = []
        features = points
        with full_precision(points):
            for conv in self.convs:
                if outputs:
                    neighbours = knn(features, features, neighbours.shape[2], in_order=True)
                features = conv(features, neighbours)
                outputs.append(features)
        return outputs

    def part_branch(self, num_parts: int) -> nn.Module:
        return PartBranch(num_parts)

    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Features (B, 2048) are maximum and mean over the points.

        Inner: (B, N) spatial order, (B, N, 512) outputs of the edge convolutions in that order.
        """
        order, neighbours = neighbourhoods or self.neighbourhoods(points)
        edges = torch.cat(self.edge_features(gather_rows(points, order), neighbours), dim=-1)
        linear, norm = cast(nn.Linear, self.aggregate[0]), cast(RowBatchNorm, self.aggregate[1])
        rows = norm.after(linear, edges)  # (B, N, 1024)
        rows = functional.leaky_relu_(rows, _SLOPE)
        return Encoding(torch.cat([max_over_points(rows), rows.mean(dim=1)], dim=-1), (order, edges))
