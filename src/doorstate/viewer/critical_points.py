# SPDX-License-Identifier: Apache-2.0
"""Critical points of a cloud: how many channels of the global feature come from each point.

A channel of a maximum comes from the point that has it. For PointNet that is exact (critical points of Qi et al.,
2017, section 4.3). Where the point is a centre that stands for a neighbourhood, it passes its channels on to the
members, in proportion to the channels that each of them won in the maximum of that neighbourhood; layers between two
maxima are taken to mix channels evenly. A channel that ends as zero comes from no point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from doorstate.clouds.normalization import NORMALIZATIONS, Normalization
from doorstate.networks.base import PointNetwork
from doorstate.networks.dgcnn import DGCNN
from doorstate.networks.kernels.winners import first_winner
from doorstate.networks.layers.point_mlp import DenseMax
from doorstate.networks.point2sequence import Point2Sequence
from doorstate.networks.pointnet import PointNet
from doorstate.networks.pointnet2 import PointNet2
from doorstate.types import Points


def critical_points(
    network: PointNetwork, points: Points, normalization: Normalization = NORMALIZATIONS["whole"]
) -> NDArray[np.float32] | None:
    """Count the channels of the global feature by the point that they come from.

    DGCNN's edge convolutions and the mean half of its feature are not followed: its points stand for their neighbours.

    Args:
        network: network in evaluation mode.
        points: (N, 3) metres in farthest-point order.
        normalization: of the clouds that the network takes.

    Returns:
        (N,) counts, whole numbers for PointNet and DGCNN, which sum to the number of channels above zero; None for
        networks without a maximum over points.
    """
    cloud = torch.from_numpy(normalization(points))[None]
    with torch.inference_mode():
        if isinstance(network, DGCNN):
            counts = _count_in_dgcnn(network, cloud)
        elif isinstance(network, PointNet | PointNet2 | Point2Sequence):
            counts = _count_through_maxima(network, cloud)
        else:
            return None
    return cast(NDArray[np.float32], counts.numpy())


def _count_through_maxima(network: PointNet | PointNet2 | Point2Sequence, cloud: Tensor) -> Tensor:
    indices = network.neighbourhoods(cloud)
    with _recorded_wins(network) as wins:
        network.features(cloud, indices)
    counts = torch.zeros(cloud.shape[1])
    if isinstance(network, PointNet):
        return wins[network.encoder[-1]][0]
    if isinstance(network, PointNet2):
        counts[: network.level2.num_centres] = wins[network.level3.pool][0]
        scales = len(network.level1.balls)
        for level, balls in ((network.level2, indices[scales:]), (network.level1, indices[:scales])):
            counts = _spread_to_members(counts, _wins_of(level.mlps, wins), balls)
        return counts
    counts[: network.num_centres] = wins[network.globals.pool][0]
    area_wins = _wins_of(network.mlps, wins)
    areas = [indices[0][..., : area.shape[1]] for area in area_wins]
    return _spread_to_members(counts, area_wins, areas)


def _count_in_dgcnn(network: DGCNN, cloud: Tensor) -> Tensor:
    order, neighbours = network.neighbourhoods(cloud)
    edges = network.edge_features(cloud[:, order[0]], neighbours)
    _, winners = first_winner(network.aggregate(torch.cat(edges, dim=-1)))
    return torch.bincount(order[0][winners[0]], minlength=cloud.shape[1]).float()


@contextmanager
def _recorded_wins(network: nn.Module) -> Iterator[dict[nn.Module, Tensor]]:
    """Record for every maximum the (M, K) channels above zero that each of the K points of M neighbourhoods wins."""
    wins: dict[nn.Module, Tensor] = {}

    def record(pool: nn.Module, inputs: tuple[Any, ...]) -> None:
        assert isinstance(pool, DenseMax)
        rows = inputs[0].flatten(0, -3)  # (M, K, C)
        largest, winner = first_winner(functional.linear(rows, *pool.norm.fold(pool.linear)))
        wins[pool] = torch.zeros(rows.shape[:2]).scatter_add_(1, winner, (largest > 0).float())

    handles = [
        module.register_forward_pre_hook(record)
        for module in network.modules()
        if isinstance(module, DenseMax)
    ]
    try:
        yield wins
    finally:
        for handle in handles:
            handle.remove()


def _wins_of(mlps: nn.ModuleList, wins: dict[nn.Module, Tensor]) -> list[Tensor]:
    return [wins[cast(nn.Module, mlp.pool)] for mlp in mlps]


def _spread_to_members(counts: Tensor, wins: Sequence[Tensor], indices: Sequence[Tensor]) -> Tensor:
    """Spread the counts of the centres, the first M points, over the members of their neighbourhoods.

    Args:
        counts: (N,), zero but for the centres.
        wins: (M, K) channels that each member won, for one or more neighbourhoods per centre.
        indices: (1, M, K) the members.

    Returns:
        (N,) counts.
    """
    total = torch.stack([channels.sum(1) for channels in wins]).sum(0)
    per_channel = counts[: len(total)] / total.clamp_min(1)
    spread = torch.zeros_like(counts)
    for channels, members in zip(wins, indices, strict=True):
        spread.index_add_(0, members.flatten(), (channels * per_channel[:, None]).flatten())
    return spread
