# SPDX-License-Identifier: Apache-2.0
"""First points of a cloud within a radius of each centre (grouping of PointNet++).

Most balls are full after few points. The cloud is searched in runs of points, and a centre drops out when its slots
are full; the hits are the same as those of a search of all points, because they are taken in index order.
On another device than the CPU all points are searched.
"""

from __future__ import annotations

import torch
from torch import Tensor

from doorstate.networks.kernels.distances import coordinate_distances
from doorstate.networks.kernels.pieces import on_cpu, pieces
from doorstate.networks.kernels.precision import at_least_float32, full_precision

_POINTS_AT_ONCE = 512


def ball_query(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """Return the first points, in index order, strictly closer than a radius.

    Args:
        centres: (B, M, 3), each also one of the points, so that no ball is empty.
        points: (B, N, 3).
        radius: in the unit of the points.
        num_samples: slots per centre; remaining slots repeat the first hit.

    Returns:
        (B, M, num_samples) int64 indices into points.
    """
    centres, points = at_least_float32(centres.detach()), at_least_float32(points.detach())
    with full_precision(points):
        if torch.compiler.is_exporting():
            return _first_hits_of_all(centres, points, radius, num_samples)
        if not on_cpu(points):
            runs = pieces(centres.shape[1], points.shape[0] * points.shape[1], points)
            found = [_first_hits_of_all(centres[:, run], points, radius, num_samples) for run in runs]
            return torch.cat(found, dim=1)
        clouds = zip(centres, points, strict=True)
        return torch.stack([_first_hits(*cloud, radius, num_samples) for cloud in clouds])


def _first_hits(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """Compute `ball_query` of one cloud; a centre drops out when its slots are full."""
    slots = torch.arange(num_samples, device=points.device)
    hit_indices = slots.new_zeros(len(centres) * num_samples)
    count = slots.new_zeros(len(centres))
    open_centres = torch.arange(len(centres), device=points.device)
    for start in range(0, len(points), _POINTS_AT_ONCE):
        run = points[None, start : start + _POINTS_AT_ONCE]
        squared = coordinate_distances(centres[None].index_select(1, open_centres), run)[0]
        row, column = (squared < radius**2).nonzero(as_tuple=True)  # by row, then by column
        num_hits = row.bincount(minlength=len(open_centres))
        first = num_hits.cumsum(0) - num_hits - count.index_select(0, open_centres)
        slot = torch.arange(len(row), device=row.device) - first.index_select(0, row)
        kept = (slot < num_samples).nonzero().squeeze(1)
        place = open_centres.index_select(0, row[kept]) * num_samples + slot[kept]
        hit_indices.index_copy_(0, place, column[kept] + start)
        count.index_add_(0, open_centres, num_hits)
        open_centres = (count < num_samples).nonzero().squeeze(1)
        if not len(open_centres):
            break
    hit_indices = hit_indices.view(-1, num_samples)
    return torch.where(slots < count.unsqueeze(1), hit_indices, hit_indices[:, :1])


def _first_hits_of_all(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """Compute `ball_query` with shapes that do not depend on the points, as one graph."""
    num_points = points.shape[1]
    k = num_samples if num_points >= num_samples else num_points
    hits = coordinate_distances(centres, points) < radius**2
    # The first points count most, the others nothing. As float32, which onnxruntime sorts faster than integers.
    countdown = torch.arange(num_points, 0, -1, device=points.device, dtype=torch.float32)
    index = num_points - (hits.to(torch.float32) * countdown).topk(k).values.to(torch.int64)  # (B, M, k)
    first = index[..., :1]
    index = torch.where(index < num_points, index, first)  # there are no more
    return torch.cat([index, first.expand(-1, -1, num_samples - k)], dim=-1)
