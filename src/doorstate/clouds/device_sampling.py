# SPDX-License-Identifier: Apache-2.0
"""Farthest point sampling of many clouds at once by torch, on any device, with the indices of the other samplers.

Each step is a few operations on all points of all clouds, and nothing waits for the device. A CPU is quicker with
`samplers.choose_sampler`; a GPU needs many clouds, because it takes about as long for one. Importing this module
imports torch.
"""

from __future__ import annotations

import torch
from torch import Tensor

from doorstate.clouds.samplers import Sampler
from doorstate.clouds.slab_sampling import leaf_ranks
from doorstate.types import Indices, Points


def farthest_points(points: Tensor, count: int, ranks: Tensor | None = None) -> Tensor:
    """Return rows in farthest-point order, from row 0 of each cloud.

    Args:
        points: (B, N, 3) float32, finite.
        count: number of rows to choose.
        ranks: (B, N) int64, of equally far points the one with the lowest is chosen; None: the row number.

    Returns:
        (B, count) int64.
    """
    batch, num_points, _ = points.shape
    xyz = points.permute(2, 0, 1).contiguous()  # (3, B, N)
    ranks = torch.arange(num_points, device=points.device) if ranks is None else ranks
    reversed_ranks = num_points - 1 - ranks
    squared = points.new_full((batch, num_points), torch.inf)
    chosen = torch.empty(batch, count, dtype=torch.int64, device=points.device)
    position = torch.zeros(batch, 1, dtype=torch.int64, device=points.device)
    for number in range(count):
        chosen[:, number : number + 1] = position
        # One operation after the other: fused ones would round squares otherwise than the samplers of CPUs.
        x, y, z = (xyz - xyz.gather(2, position.expand(3, -1, -1))).square_()
        squared = torch.minimum(squared, (x + y).add_(z))
        # Bits of floats that are not negative order as integers do; the rank below them settles ties.
        keys = squared.view(torch.int32).long().bitwise_left_shift_(32).bitwise_or_(reversed_ranks)
        position = keys.argmax(1, keepdim=True)
    return chosen


def device_sampler(device: torch.device) -> Sampler:
    """Return the form of `farthest_points` for one cloud."""

    def choose(points: Points, count: int, height: int) -> Indices:
        ranks = torch.from_numpy(leaf_ranks(points.T, height)).to(device)
        chosen = farthest_points(torch.from_numpy(points).to(device)[None], count, ranks[None])
        indices: Indices = chosen[0].cpu().numpy()
        return indices

    return Sampler(f"torch on {device.type}", choose)
