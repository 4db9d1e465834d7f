# SPDX-License-Identifier: Apache-2.0
"""Means over the processes that train one network together, each on its share of the batch.

The loss is the mean of the ranks' losses. What is averaged forward is used by every rank, so its gradient is averaged
backward in the same way; after the gradients of the parameters are averaged, too, they are those of one process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, distributed
from torch.autograd.function import once_differentiable


def mean_over_ranks(values: Tensor) -> Tensor:
    """Return the mean of values of the same shape over all ranks, with its gradient."""
    return _mean(values)


def moments_over_ranks(mean: Tensor, covariance: Tensor) -> tuple[Tensor, Tensor]:
    """Return mean and covariance of the rows of all ranks, from those of equally many rows of each.

    Args:
        mean: (C,) of the rows of this rank.
        covariance: (C, C) of these rows, divided by their number.
    """
    mean_of_all = mean_over_ranks(mean)
    step = mean - mean_of_all
    return mean_of_all, mean_over_ranks(covariance + torch.outer(step, step))


class _MeanOverRanks(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:
        return _averaged(values)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> Tensor:
        return _averaged(grad)


def _averaged(values: Tensor) -> Tensor:
    total = values.detach().contiguous().clone()
    distributed.all_reduce(total)
    return total / distributed.get_world_size()


_mean: Callable[[Tensor], Tensor] = _MeanOverRanks.apply
