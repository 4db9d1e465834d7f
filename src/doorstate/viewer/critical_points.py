# SPDX-License-Identifier: Apache-2.0
"""What a network looked at: how many channels of the global feature come from each point of a cloud."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from doorstate.clouds.normalization import normalize
from doorstate.networks.base import PointNetwork
from doorstate.networks.dgcnn import DGCNN
from doorstate.networks.kernels.ops import first_winner
from doorstate.networks.layers import DenseMax
from doorstate.networks.point2sequence import Point2Sequence
from doorstate.networks.pointnet import PointNet
from doorstate.networks.pointnet2 import PointNet2
from doorstate.types import Points

# A channel of a maximum comes from the point that has it. That is exact for PointNet, whose critical points these are
# (Qi et al. 2017, section 4.3). Where the point is a centre that stands for others, it hands its channels down to
# them, in the shares in which they won the maxima of its own neighbourhood; what is between two maxima is taken to
# mix channels evenly. Channels that end as zero come from no point.


def critical_points(network: PointNetwork, points: Points) -> NDArray[np.float32] | None:
    """Channels of the global feature by the point that they come from; their sum is the number of channels above zero.

    DGCNN's edge convolutions and the mean half of its feature are not followed: its points stand for their neighbours.

    Args:
        network: in evaluation mode.
        points: (N, 3) metres in farthest-point order.

    Returns:
        (N,) counts, whole numbers of PointNet and DGCNN; None of networks that pool no maximum over points.
    """
    cloud = torch.from_numpy(normalize(points))[None]
    with torch.inference_mode():
        if isinstance(network, DGCNN):
            counts = _dgcnn(network, cloud)
        elif isinstance(network, PointNet | PointNet2 | Point2Sequence):
            counts = _through_maxima(network, cloud)
        else:
            return None
    return cast(NDArray[np.float32], counts.numpy())


def _through_maxima(network: PointNet | PointNet2 | Point2Sequence, cloud: Tensor) -> Tensor:
    indices = network.neighbourhoods(cloud)
    with _recorded_winners(network) as won:
        network.features(cloud, indices)
    counts = torch.zeros(cloud.shape[1])
    if isinstance(network, PointNet):
        return won[network.encoder[-1]][0]
    if isinstance(network, PointNet2):
        counts[: network.level2.num_centres] = won[network.level3.pool][0]
        scales = len(network.level1.balls)
        for level, balls in ((network.level2, indices[scales:]), (network.level1, indices[:scales])):
            counts = _handed_down(counts, _of_each(level.mlps, won), balls)
        return counts
    counts[: network.num_centres] = won[network.globals.pool][0]
    areas = _of_each(network.mlps, won)
    return _handed_down(counts, areas, [indices[0][..., : area.shape[1]] for area in areas])


def _dgcnn(network: DGCNN, cloud: Tensor) -> Tensor:
    order, neighbours = network.neighbourhoods(cloud)
    edges = network.edge_features(cloud[:, order[0]], neighbours)
    _, winners = first_winner(network.aggregate(torch.cat(edges, dim=-1)))
    return torch.bincount(order[0][winners[0]], minlength=cloud.shape[1]).float()


@contextmanager
def _recorded_winners(network: nn.Module) -> Iterator[dict[nn.Module, Tensor]]:
    """Of every maximum: (M, K) channels above zero that each of the K points of M neighbourhoods won."""
    won: dict[nn.Module, Tensor] = {}

    def record(pool: nn.Module, inputs: tuple[Any, ...]) -> None:
        assert isinstance(pool, DenseMax)
        rows = inputs[0].flatten(0, -3)  # (M, K, C)
        largest, winner = first_winner(functional.linear(rows, *pool.norm.fold(pool.linear)))
        won[pool] = torch.zeros(rows.shape[:2]).scatter_add_(1, winner, (largest > 0).float())

    handles = [
        module.register_forward_pre_hook(record)
        for module in network.modules()
        if isinstance(module, DenseMax)
    ]
    try:
        yield won
    finally:
        for handle in handles:
            handle.remove()


def _of_each(mlps: nn.ModuleList, won: dict[nn.Module, Tensor]) -> list[Tensor]:
    return [won[cast(nn.Module, mlp.pool)] for mlp in mlps]


def _handed_down(counts: Tensor, won: Sequence[Tensor], indices: Sequence[Tensor]) -> Tensor:
    """(N,) counts of centres, the first M points, spread over the members of one or more neighbourhoods of each.

    Args:
        counts: (N,).
        won: (M, K) channels that each member won, per neighbourhood.
        indices: (1, M, K) the members.
    """
    total = torch.stack([each.sum(1) for each in won]).sum(0)
    each_channel = counts[: len(total)] / total.clamp_min(1)
    spread = torch.zeros_like(counts)
    for channels, members in zip(won, indices, strict=True):
        spread.index_add_(0, members.flatten(), (channels * each_channel[:, None]).flatten())
    return spread
