# SPDX-License-Identifier: Apache-2.0
"""The same architectures built from modules of PyTorch Geometric, if it is installed."""

from __future__ import annotations

from importlib import import_module, util
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.errors import RunError
from doorstate.types import STATES

Batch = tuple[Tensor, Tensor]  # (B * N, 3) positions, (B * N,) cloud of each


def build_pyg(network: str) -> nn.Module:
    """Return a network with the methods of ours.

    Raises:
        RunError: PyTorch Geometric is not installed.
    """
    if util.find_spec("torch_geometric") is None:
        raise RunError("torch_geometric is not installed")
    module: nn.Module = NETWORKS[network](import_module("torch_geometric.nn"))
    return module


class _Network(nn.Module):
    """Network on clouds that are concatenated in one tensor, as in PyTorch Geometric."""

    def forward(self, points: Tensor) -> Tensor:
        """Return (B, 3) logits of (B, N, 3) points."""
        batch, num_points, _ = points.shape
        return self.logits(points.flatten(0, 1), torch.arange(batch).repeat_interleave(num_points))

    def logits(self, positions: Tensor, batch: Tensor) -> Tensor:
        """Return (B, 3) logits of (B * N, 3) positions."""
        raise NotImplementedError

    def training_loss(self, points: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """Return cross entropy and logits."""
        logits = self(points)
        return functional.cross_entropy(logits, labels), logits


class _PointNet2(_Network):
    """PointNet++ with single-scale grouping, on `PointNetConv`."""

    def __init__(self, pyg: Any) -> None:
        super().__init__()
        self.pyg = pyg
        self.level1 = pyg.PointNetConv(_mlp(3, 64, 64, 128), add_self_loops=False)
        self.level2 = pyg.PointNetConv(_mlp(131, 128, 128, 256), add_self_loops=False)
        self.level3 = _mlp(259, 256, 512, 1024)
        self.head = _head(1024)

    def logits(self, positions: Tensor, batch: Tensor) -> Tensor:
        features, first = self._level(self.level1, None, (positions, batch), 512, 0.2, 32)
        features, second = self._level(self.level2, features, first, 128, 0.4, 64)
        rows = self.level3(torch.cat([features, second[0]], dim=-1))
        logits: Tensor = self.head(self.pyg.global_max_pool(rows, second[1]))
        return logits

    def _level(
        self, conv: nn.Module, features: Tensor | None, points: Batch, centres: int, radius: float, slots: int
    ) -> tuple[Tensor, Batch]:
        indices = _farthest(self.pyg, points, centres)
        centre_points = (points[0][indices], points[1][indices])
        centre, point = self.pyg.radius(
            points[0], centre_points[0], radius, points[1], centre_points[1], max_num_neighbors=slots
        )
        centre_features = None if features is None else features[indices]
        edges = torch.stack([point, centre])
        rows = conv((features, centre_features), (points[0], centre_points[0]), edges)
        return rows, centre_points


class _DGCNN(_Network):
    """DGCNN on `DynamicEdgeConv`."""

    def __init__(self, pyg: Any) -> None:
        super().__init__()
        self.pyg = pyg
        self.convs = nn.ModuleList(
            pyg.DynamicEdgeConv(_mlp(2 * a, b, slope=0.2, bias=False), k=20, aggr="max")
            for a, b in ((3, 64), (64, 64), (64, 128), (128, 256))
        )
        self.aggregate = _mlp(512, 1024, slope=0.2, bias=False)
        self.head = _head(2048)

    def logits(self, positions: Tensor, batch: Tensor) -> Tensor:
        outputs, rows = [], positions
        for conv in self.convs:
            rows = conv(rows, batch)
            outputs.append(rows)
        rows = self.aggregate(torch.cat(outputs, dim=-1))
        pooled = [self.pyg.global_max_pool(rows, batch), self.pyg.global_mean_pool(rows, batch)]
        logits: Tensor = self.head(torch.cat(pooled, dim=-1))
        return logits


class _PointCNN(_Network):
    """PointCNN with four levels, on `XConv`, which searches neighbours of all points and not only of the centres."""

    _LEVELS = ((0, 48, 8, 24, 1), (48, 96, 12, 12, 2), (96, 192, 16, 24, 2), (192, 384, 16, 48, 3))
    _CENTRES = (None, 384, 128, None)

    def __init__(self, pyg: Any) -> None:
        super().__init__()
        self.pyg = pyg
        self.convs = nn.ModuleList(
            pyg.XConv(before, after, dim=3, kernel_size=k, hidden_channels=lifted, dilation=dilation)
            for before, after, k, lifted, dilation in self._LEVELS
        )
        self.head = _head(384)

    def logits(self, positions: Tensor, batch: Tensor) -> Tensor:
        points, features = (positions, batch), None
        for conv, centres in zip(self.convs, self._CENTRES, strict=True):
            if centres is not None and features is not None:
                indices = _farthest(self.pyg, points, centres)
                points, features = (points[0][indices], points[1][indices]), features[indices]
            features = functional.elu(conv(features, *points))
        logits: Tensor = self.head(self.pyg.global_mean_pool(features, points[1]))
        return logits


NETWORKS = {"pointnet2": _PointNet2, "dgcnn": _DGCNN, "pointcnn": _PointCNN}


def _farthest(pyg: Any, points: Batch, count: int) -> Tensor:
    """Return the indices of `count` points per cloud in farthest-point order."""
    per_cloud = len(points[1]) // (int(points[1][-1]) + 1)
    indices: Tensor = pyg.fps(*points, ratio=min(1.0, count / per_cloud))
    return indices


def _mlp(*channels: int, slope: float = 0.0, bias: bool = True) -> nn.Sequential:
    layers: list[nn.Module] = []
    for before, after in pairwise(channels):
        layers += [nn.Linear(before, after, bias), nn.BatchNorm1d(after), nn.LeakyReLU(slope)]
    return nn.Sequential(*layers)


def _head(in_channels: int) -> nn.Sequential:
    return nn.Sequential(_mlp(in_channels, 512, 256), nn.Dropout(0.5), nn.Linear(256, len(STATES)))
