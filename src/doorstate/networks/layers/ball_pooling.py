# SPDX-License-Identifier: Apache-2.0
"""PointNet on balls without the slots that repeat a point, for exported networks.

A repeated point changes no maximum, and the balls of the second level of PointNet++ are half empty. The first layer
commutes with grouping: W [x_j - c; f_j] = W [x_j; f_j] - W_x c, so it is computed once for each point and each centre.
onnxruntime multiplies, shifts and clips the rows of a matrix in one step.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional

from doorstate.networks.kernels.gather import flat_rows
from doorstate.networks.layers.point_mlp import PooledMLP

_RUN = 8  # slots that are evaluated or skipped together


def pool_balls(
    pooled_mlp: PooledMLP, points: Tensor, centres: Tensor, features: Tensor | None, indices: Tensor
) -> Tensor:
    """Return what `pooled_mlp` gives for the balls, in evaluation mode.

    Args:
        pooled_mlp: layers on [offset from the centre; features] of a point.
        points: (B, N, 3).
        centres: (B, M, 3).
        features: (B, N, C) of the points, if the layers take any.
        indices: (B, M, K) points of the balls, as from `ball_query`.

    Returns:
        (B, M, C').
    """
    batch, num_balls, slots = indices.shape
    size = math.gcd(slots, _RUN)
    runs_a_ball = slots // size
    runs = flat_rows(points, indices).view(-1, runs_a_ball, size)  # (B * M, runs, size)
    is_first = torch.arange(runs_a_ball, device=points.device) == 0
    is_used = (
        is_first | (runs[..., 0] != runs[:, :1, 0])
    ).flatten()  # the others repeat the first point of the ball
    used = is_used.nonzero().squeeze(1)
    rows = runs.view(-1, size).index_select(0, used).flatten()

    mlp = pooled_mlp.mlp
    weight, bias = mlp.norm.fold(mlp.first)
    inputs = points if features is None else torch.cat([points, features], dim=-1)
    of_points = functional.linear(inputs.flatten(0, 1), weight, bias)
    of_centres = functional.linear(centres.flatten(0, 1), weight[:, :3])
    neighbours = of_points.index_select(0, rows).view(-1, size, len(weight))
    first = neighbours - of_centres.index_select(0, used // runs_a_ball).unsqueeze(1)
    hidden = mlp.rest(first.relu().flatten(0, 1))
    largest = pooled_mlp.pool(hidden.view(-1, size, hidden.shape[-1]))  # (used runs, C')
    # A run that is not used stands for the last used one before it, which is of the same ball.
    last = is_used.cumsum(0) - 1
    pooled: Tensor = largest.index_select(0, last).view(batch, num_balls, runs_a_ball, -1).amax(2)
    return pooled
