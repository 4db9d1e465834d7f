# SPDX-License-Identifier: Apache-2.0
"""Squared distances between all queries and all points.

Coordinates take differences, which are exact for equal points. Features take |p|^2 - 2 q p, a matrix product: |q|^2 is
the same for all points of a query and does not change their order.
"""

from __future__ import annotations

import torch
from torch import Tensor


def coordinate_distances(query: Tensor, points: Tensor) -> Tensor:
    """Return (B, M, N) squared distances of (B, M, 3) and (B, N, 3) coordinates, exactly zero for equal points."""
    columns = points.mT.contiguous()  # (B, 3, N)
    squared = (query[..., :1] - columns[:, :1]).square_()
    for axis in (1, 2):
        difference = query[..., axis : axis + 1] - columns[:, axis : axis + 1]
        squared.addcmul_(difference, difference)
    return squared


def feature_distances(query: Tensor, points: Tensor) -> Tensor:
    """Return (B, M, N) squared distances up to a constant per query, which keeps the order of the points."""
    origin = points.mean(dim=1, keepdim=True)  # far from the origin, squares lose digits
    points = points - origin
    squared_norms = points.square().sum(-1).unsqueeze(1)  # (B, 1, N)
    return torch.baddbmm(squared_norms, query - origin, points.mT, alpha=-2)
