# SPDX-License-Identifier: Apache-2.0
"""Rows of a batch of clouds by index."""

from __future__ import annotations

import torch
from torch import Tensor


def gather_rows(values: Tensor, indices: Tensor) -> Tensor:
    """Select rows of each cloud.

    Args:
        values: (B, N, C).
        indices: (B, ...) int64 row numbers within the same cloud.

    Returns:
        (B, ..., C). As index_select on flattened rows: the backward of `values[indices]` is slow on CPUs.
    """
    rows = flat_rows(values, indices).reshape(-1)
    return values.flatten(0, 1).index_select(0, rows).view(*indices.shape, values.shape[-1])


def first_rows(values: Tensor, count: int) -> Tensor:
    """Return the first `count` rows of each cloud, (B, min(count, N), C) of (B, N, C); all if there are fewer."""
    if torch.compiler.is_exporting():
        # A slice would limit the graph to clouds of more than `count` points, or of fewer.
        number = torch.sym_min(count, values.shape[1])  # type: ignore[no-untyped-call]
        return values.index_select(1, torch.arange(number, device=values.device))
    return values[:, :count]


def flat_rows(values: Tensor, indices: Tensor) -> Tensor:
    """Return (B, ...) row numbers in the flattened batch, for (B, ...) indices within each cloud."""
    batch, num_rows, _ = values.shape
    first_row = num_rows * torch.arange(batch, device=values.device)
    return indices + first_row.view(-1, *[1] * (indices.dim() - 1))
