# SPDX-License-Identifier: Apache-2.0
"""Edge convolution without the edges' inputs [x_j - x_i; x_i] (DGCNN).

With W = [A, B], W [x_j - x_i; x_i] = A x_j + (B - A) x_i: two products per point instead of one per edge, and the
maximum over j concerns A x_j alone. Batch normalisation folds into W and a bias, because mean and covariance of the
edges' inputs follow from sums over points: with x centred, s_j the share of edges that end in x_j and n_i the sum of
the neighbours of i,

    E[x_j] = sum_j s_j x_j,   E[x_j x_j^T] = sum_j s_j x_j x_j^T,   E[x_j x_i^T] = sum_i n_i x_i^T / #edges.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from doorstate.networks.kernels.neighbour_max import neighbour_max
from doorstate.networks.kernels.neighbour_sum import neighbour_sum


def edge_max(features: Tensor, indices: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Return the maximum over the neighbours j of W [x_j - x_i; x_i] + b.

    Args:
        features: (B, N, C) x.
        indices: (B, N, k) neighbours j of each point i.
        weight: (C_out, 2C) W.
        bias: (C_out,) b.

    Returns:
        (B, N, C_out).
    """
    difference, own = weight.chunk(2, dim=1)
    neighbour = functional.linear(features, difference)  # (B, N, C_out): A x
    centre = functional.linear(features, own - difference, bias)  # (B, N, C_out): (B - A) x + b
    return neighbour_max(neighbour, indices) + centre


def edge_moments(features: Tensor, indices: Tensor) -> tuple[Tensor, Tensor]:
    """Return mean and covariance of [x_j - x_i; x_i] over all edges of all clouds.

    Args:
        features: (B, N, C) x.
        indices: (B, N, k) neighbours j of each point i.

    Returns:
        (2C,) mean and (2C, 2C) covariance divided by the number of edges.
    """
    per_edge = features.new_full((1,), 1 / indices.numel()).expand(len(indices), indices[0].numel())
    share = features.new_zeros(indices.shape[:2]).scatter_add_(1, indices.flatten(1), per_edge)  # (B, N)
    share = share.view(-1, 1)  # (B * N, 1) of all edges
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
