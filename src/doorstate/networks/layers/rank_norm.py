# SPDX-License-Identifier: Apache-2.0
"""Batch normalisation with the statistics of the batch of all ranks."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from doorstate.networks.kernels.precision import at_least_float32, full_precision
from doorstate.networks.kernels.ranks import mean_over_ranks


def normalize_over_ranks(
    norm: nn.BatchNorm1d | nn.BatchNorm2d, rows: Tensor, num_ranks: int, bias: Tensor | None = None
) -> Tensor:
    """Normalise rows + bias in training, and update the running statistics.

    Args:
        norm: layer with the settings and running statistics.
        rows: (R, C), the same R on every rank.
        num_ranks: number of ranks.
        bias: (C,) as in `RowBatchNorm.add_bias_and_normalize`.

    Returns:
        (R, C).
    """
    with full_precision(rows):
        wide = at_least_float32(rows)
        mean = mean_over_ranks(wide.mean(0))
        centred = wide - mean
        variance = mean_over_ranks(centred.square().mean(0))
        shift = norm.bias if bias is None else norm.bias + 0 * bias
        normalized = centred * (norm.weight * torch.rsqrt(variance + norm.eps)) + shift
    update_running(norm, mean if bias is None else mean + bias, variance, num_ranks * len(rows))
    return normalized.to(rows.dtype)


@torch.no_grad()
def update_running(norm: nn.BatchNorm1d | nn.BatchNorm2d, mean: Tensor, variance: Tensor, count: int) -> None:
    """Move the running statistics towards (C,) mean and variance, divided by the count, of `count` rows."""
    assert norm.running_mean is not None
    assert norm.running_var is not None
    assert norm.num_batches_tracked is not None
    assert norm.momentum is not None
    norm.num_batches_tracked += 1
    norm.running_mean.lerp_(mean, norm.momentum)
    norm.running_var.lerp_(variance * (count / (count - 1)), norm.momentum)
