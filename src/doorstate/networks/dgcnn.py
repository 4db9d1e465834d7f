# SPDX-License-Identifier: Apache-2.0
"""DGCNN: edge convolutions on a graph rebuilt in feature space (Wang et al., 2019, arXiv:1801.07829)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.base import PointNetwork
from doorstate.networks.layers import RowBatchNorm, set_batchnorm
from doorstate.networks.ops import full_precision, knn, max_over, reduce_neighbours

_SLOPE = 0.2


class EdgeConv(nn.Module):
    """max over neighbours j of LeakyReLU(BatchNorm(W [x_j - x_i; x_i])), without building the edges' inputs.

    With W = [A, B], W [x_j - x_i; x_i] = A x_j + (B - A) x_i: two products per point. BatchNorm and LeakyReLU
    are monotone per channel: the maximum is taken of A x_j, the minimum where the norm's scale is negative.
    The batch statistics stay those of all edges.
    """

    def __init__(self, in_channels: int, out_channels: int) -> None:
        super().__init__()
        self.linear = nn.Linear(2 * in_channels, out_channels, bias=False)
        self.norm = RowBatchNorm(out_channels)

    def forward(self, features: Tensor, indices: Tensor) -> Tensor:
        """(B, N, C_out) of (B, N, C) features and (B, N, k) neighbours."""
        difference, own = self.linear.weight.chunk(2, dim=1)
        neighbour = functional.linear(features, difference)  # (B, N, C_out): A x
        centre = functional.linear(features, own - difference)  # (B, N, C_out): (B - A) x
        sign = torch.where(self.norm.weight.detach() < 0, -1.0, 1.0).to(neighbour.dtype)
        edge = reduce_neighbours(neighbour * sign, indices, "max") * sign + centre
        if self.training:
            mean, variance = edge_statistics(neighbour, centre, indices)
            edge = self.norm.normalize(edge, mean, variance, count=indices.numel())
        else:
            edge = self.norm(edge)
        return functional.leaky_relu(edge, _SLOPE)


def edge_statistics(neighbour: Tensor, centre: Tensor, indices: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and variance of u_j + v_i over all edges of all clouds, without the edges.

    Args:
        neighbour: (B, N, C) u.
        centre: (B, N, C) v.
        indices: (B, N, k) neighbours j of each point i.

    Returns:
        (C,) mean and (C,) variance divided by the number of edges.
    """
    batch, num_points, k = indices.shape
    share = neighbour.new_full((1,), 1 / indices.numel()).expand(batch, num_points * k)
    share = neighbour.new_zeros(batch, num_points).scatter_add(1, indices.flatten(1), share)
    share = share.unsqueeze(-1)  # (B, N, 1) of the edges that end in a point
    neighbour_mean = (share * neighbour).sum(dim=(0, 1))
    centre_mean = centre.mean(dim=(0, 1))
    u, v = neighbour - neighbour_mean, centre - centre_mean  # centred, so that the squares do not cancel
    neighbour_sum = reduce_neighbours(u, indices, "sum")  # (B, N, C)
    variance = (share * u.square()).sum(dim=(0, 1)) + v.square().mean(dim=(0, 1))
    variance = variance + 2 * (v * neighbour_sum).mean(dim=(0, 1)) / k
    return neighbour_mean + centre_mean, variance.clamp_min(0)


class DGCNN(PointNetwork):
    """DGCNN as in the authors' PyTorch code: no spatial transformer, LeakyReLU, maximum and mean pooling.

    Args:
        num_classes: number of logits.
        k: neighbours per point, itself included; the authors take 20 of 1024 and 40 of 2048 points.
        batchnorm_eps: epsilon of every batch normalisation.
    """

    feature_size = 2048

    def __init__(self, num_classes: int = 3, *, k: int = 20, batchnorm_eps: float = 1e-5) -> None:
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

    def edge_features(self, points: Tensor) -> list[Tensor]:
        """(B, N, 64), (B, N, 64), (B, N, 128) and (B, N, 256) outputs of the edge convolutions.

        In full precision: the factored product subtracts what bfloat16 could no longer tell apart.
        """
        outputs, features = [], points
        with full_precision(points):
            for conv in self.convs:
                features = conv(features, knn(features, features, self.k))
                outputs.append(features)
        return outputs

    def features(self, points: Tensor) -> Tensor:
        """(B, 2048) maximum and mean over the points."""
        rows = self.aggregate(torch.cat(self.edge_features(points), dim=-1))  # (B, N, 1024)
        return torch.cat([max_over(rows, dim=1), rows.mean(dim=1)], dim=-1)
