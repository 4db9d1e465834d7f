# SPDX-License-Identifier: Apache-2.0
"""Order of points in which every run of points lies together."""

from __future__ import annotations

import torch
from torch import Tensor

from doorstate.networks.kernels.gather import gather_rows
from doorstate.networks.kernels.pieces import on_cpu

BLOCK_SIZES = range(12, 24)
"""Numbers of points of a block that make `knn_blocks` fast."""


def spatial_order(points: Tensor) -> Tensor:
    """Return an order in which every run of points lies together: the leaves of a k-d tree with equal halves.

    Only the time of later searches depends on it. An exported graph and devices other than the CPU keep the given
    order: they compute all distances.

    Args:
        points: (B, N, D).

    Returns:
        (B, N) int64 permutation of each cloud.
    """
    batch, num_points, dimensions = points.shape
    order = torch.arange(num_points, device=points.device).expand(batch, -1)
    if torch.compiler.is_exporting() or not on_cpu(points):
        return order
    size, smallest = num_points, block_size(num_points)
    while size > smallest:
        cells = points.reshape(-1, size, dimensions)
        widest = (cells.amax(1) - cells.amin(1)).argmax(-1).view(-1, 1, 1)
        along = cells.gather(2, widest.expand(-1, size, 1)).squeeze(2).argsort(dim=1)  # (cells, size)
        order = order.reshape(-1, size).gather(1, along).view(batch, -1)
        points = gather_rows(cells, along)
        size //= 2
    return order


def block_size(count: int) -> int:
    """Halve a number of points until it is a size of `BLOCK_SIZES`, or odd."""
    while count % 2 == 0 and count not in BLOCK_SIZES:
        count //= 2
    return count
