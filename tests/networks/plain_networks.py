# SPDX-License-Identifier: Apache-2.0
"""The five networks in their plain form: every neighbourhood gathered, every layer on every neighbour.

Oracle of the tests and yardstick of the benchmarks. Only the names of the networks' parameters are used.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.base import PointNetwork
from doorstate.networks.dgcnn import DGCNN
from doorstate.networks.point2sequence import AREAS, NUM_CENTRES, Point2Sequence
from doorstate.networks.pointcnn import PointCNN
from doorstate.networks.pointnet import PointNet
from doorstate.networks.pointnet2 import PointNet2


class PlainForm(nn.Module):
    """The same function as a network, with the network's own parameters and buffers.

    Args:
        network: shared, not copied; its mode (training or evaluation) holds.
    """

    def __init__(self, network: PointNetwork) -> None:
        super().__init__()
        self.network = network
        self.features = _FEATURES[type(network)]
        self.train(network.training)

    def forward(self, points: Tensor) -> Tensor:
        """(B, num_classes) logits of (B, N, 3) points."""
        features, _ = self.features(self.network, points)
        if features.dim() == 3:  # PointCNN: features of representative points
            features = features.to(points.dtype).mean(dim=1)
        return self.network.head(features).to(points.dtype)

    def training_loss(
        self, points: Tensor, labels: Tensor, label_smoothing: float = 0.0
    ) -> tuple[Tensor, Tensor]:
        """Scalar loss and (B, num_classes) logits, as `PointNetwork.training_loss`."""
        features, penalty = self.features(self.network, points)
        logits = self.network.head(features).to(points.dtype)
        rows = logits.reshape(-1, logits.shape[-1])  # (B, C), PointCNN: (B * P, C)
        repeated = labels.repeat_interleave(len(rows) // len(labels))
        loss = functional.cross_entropy(rows, repeated, label_smoothing=label_smoothing) + penalty
        return loss, rows.view(len(labels), -1, rows.shape[-1]).mean(dim=1)


def squared_distances(query: Tensor, points: Tensor) -> Tensor:
    """(M, N) of (M, D) and (N, D): exact for coordinates, |q|^2 - 2 q p + |p|^2 for features."""
    if points.shape[1] == 3:
        return sum((query[:, None, axis] - points[None, :, axis]).square() for axis in range(3))
    origin = points.mean(dim=0)  # far from the origin, squares lose digits
    query, points = query - origin, points - origin
    return query.square().sum(1)[:, None] - 2 * query @ points.T + points.square().sum(1)[None]


@torch.no_grad()
def knn(query: Tensor, points: Tensor, k: int) -> Tensor:
    """(B, M, k) nearest first; a query equal to the point of the same index finds that point first."""
    indices = []
    for queries, cloud in zip(query, points, strict=True):
        distances = squared_distances(queries, cloud)
        (same,) = (queries == cloud[: len(queries)]).all(dim=1).nonzero(as_tuple=True)
        distances[same, same] = -torch.inf
        indices.append(distances.topk(min(k, len(cloud)), largest=False).indices)
    return torch.stack(indices)


@torch.no_grad()
def ball_query(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """(B, M, num_samples) first points, in index order, closer than the radius; the first of them pads."""
    num_points = points.shape[1]
    indices = []
    for queries, cloud in zip(centres, points, strict=True):
        inside = squared_distances(queries, cloud) < radius**2
        hits = torch.where(inside, torch.arange(num_points, device=cloud.device), num_points)
        hits = hits.sort(dim=1).values[:, :num_samples]
        hits = functional.pad(hits, (0, num_samples - hits.shape[1]), value=num_points)
        indices.append(torch.where(hits < num_points, hits, hits[:, :1]))
    return torch.stack(indices)


def gather(values: Tensor, indices: Tensor) -> Tensor:
    """(B, M, k, C) rows of (B, N, C) values."""
    cloud = torch.arange(len(values), device=values.device)[:, None, None]
    return values[cloud, indices]


def batch_norm(rows: Tensor, norm: nn.BatchNorm1d) -> Tensor:
    """Over all rows, as `nn.BatchNorm1d` does."""
    if norm.training:
        norm.num_batches_tracked.add_(1)
    flat = functional.batch_norm(
        rows.reshape(-1, rows.shape[-1]),
        norm.running_mean,
        norm.running_var,
        norm.weight,
        norm.bias,
        norm.training,
        norm.momentum,
        norm.eps,
    )
    return flat.view(rows.shape)


def linear(rows: Tensor, layer: nn.Linear) -> Tensor:
    return functional.linear(rows, layer.weight, layer.bias)


def dense(rows: Tensor, layer: nn.Linear, norm: nn.BatchNorm1d) -> Tensor:
    return torch.relu(batch_norm(linear(rows, layer), norm))


def dense_layers(rows: Tensor, layers: nn.Sequential) -> Tensor:
    for layer in layers:
        rows = dense(rows, layer[0], layer[1])
    return rows


def point_mlp(rows: Tensor, module: nn.Module) -> Tensor:
    return dense_layers(dense(rows, module.first, module.norm), module.rest)


def dense_max(rows: Tensor, module: nn.Module) -> Tensor:
    return dense(rows, module.linear, module.norm).max(dim=-2).values


def pooled_mlp(rows: Tensor, module: nn.Module) -> Tensor:
    return dense_max(point_mlp(rows, module.mlp), module.pool)


def transform_net(rows: Tensor, module: nn.Module) -> Tensor:
    """(B, size, size) of (B, N, size) rows."""
    size = rows.shape[-1]
    local = point_mlp(rows, module.trunk) if size == 3 else dense_layers(rows, module.trunk)
    code = dense_layers(dense_max(local, module.pool), module.dense)
    identity = torch.eye(size, dtype=module.output.weight.dtype, device=rows.device)
    return linear(code, module.output).view(-1, size, size) + identity


def pointnet(network: PointNet, points: Tensor) -> tuple[Tensor, Tensor | float]:
    aligned = points @ transform_net(points, network.input_transform)
    rows = point_mlp(aligned, network.local)
    transform = transform_net(rows, network.feature_transform)
    *local, last = network.encoder
    features = dense_max(dense_layers(rows @ transform, local), last)
    identity = torch.eye(transform.shape[-1], dtype=transform.dtype, device=transform.device)
    distance = (transform @ transform.mT - identity).square().sum()
    return features, network.regularizer_weight * distance / 2


def set_abstraction(points: Tensor, features: Tensor | None, module: nn.Module) -> tuple[Tensor, Tensor]:
    """(B, M, 3) centres and their (B, M, C) features."""
    centres = points[:, : module.num_centres]
    pooled = []
    for (radius, num_samples), mlp in zip(module.balls, module.mlps, strict=True):
        indices = ball_query(centres, points, radius, num_samples)
        rows = gather(points, indices) - centres.unsqueeze(2)
        if features is not None:
            rows = torch.cat([rows, gather(features, indices)], dim=-1)
        pooled.append(pooled_mlp(rows, mlp))
    return centres, torch.cat(pooled, dim=-1)


def pointnet2(network: PointNet2, points: Tensor) -> tuple[Tensor, Tensor | float]:
    centres, features = set_abstraction(points, None, network.level1)
    centres, features = set_abstraction(centres, features, network.level2)
    return pooled_mlp(torch.cat([centres, features], dim=-1), network.level3), 0.0


def edge_conv(features: Tensor, k: int, module: nn.Module) -> Tensor:
    neighbours = gather(features, knn(features, features, k))
    centres = features.unsqueeze(2).expand_as(neighbours)
    edges = linear(torch.cat([neighbours - centres, centres], dim=-1), module.linear)
    return functional.leaky_relu(batch_norm(edges, module.norm), 0.2).max(dim=2).values


def dgcnn(network: DGCNN, points: Tensor) -> tuple[Tensor, Tensor | float]:
    outputs = [points]
    with torch.autocast(points.device.type, enabled=False):  # in full precision, as the network
        for conv in network.convs:
            outputs.append(edge_conv(outputs[-1], network.num_neighbours(points.shape[1]), conv))
    rows = linear(torch.cat(outputs[1:], dim=-1), network.aggregate[0])
    rows = functional.leaky_relu(batch_norm(rows, network.aggregate[1]), 0.2)
    return torch.cat([rows.max(dim=1).values, rows.mean(dim=1)], dim=-1), 0.0


def elu_dense(rows: Tensor, layers: nn.Sequential) -> Tensor:
    return batch_norm(functional.elu(linear(rows, layers[0])), layers[2])


def depthwise(rows: Tensor, weight: Tensor) -> Tensor:
    """(B, P, C, m): a convolution of every channel of (B, P, K, C) rows over all K, weight (K, C, m)."""
    k, channels, multiplier = weight.shape
    kernel = weight.permute(1, 2, 0).reshape(-1, 1, 1, k)  # (C * m, 1, 1, K)
    out = functional.conv2d(rows.permute(0, 3, 1, 2), kernel, groups=channels)  # (B, C * m, P, 1)
    return out.squeeze(-1).mT.unflatten(-1, (channels, multiplier))


def x_matrices(offsets: Tensor, module: nn.Module) -> Tensor:
    """(B, P, K, K) of (B, P, K, 3) coordinates relative to the representative point."""
    square = (offsets.shape[2], offsets.shape[2])
    rows = batch_norm(functional.elu(linear(offsets.flatten(2), module.linear)), module.norm0)
    rows = depthwise(rows.unflatten(-1, square), module.depthwise1).flatten(2)
    rows = batch_norm(functional.elu(rows), module.norm1)
    rows = depthwise(rows.unflatten(-1, square), module.depthwise2).flatten(2)
    return batch_norm(rows, module.norm2).unflatten(-1, square)


def x_conv(points: Tensor, features: Tensor | None, module: nn.Module) -> tuple[Tensor, Tensor]:
    """(B, P, 3) representative points and their (B, P, C) features."""
    representatives = points[:, : module.num_representatives]
    dilation = min(module.dilation, points.shape[1] // module.k)
    indices = knn(representatives, points, module.k * dilation)[..., ::dilation]
    offsets = gather(points, indices) - representatives.unsqueeze(2)
    rows = elu_dense(elu_dense(offsets, module.lift[0]), module.lift[1])
    if features is not None:
        rows = torch.cat([rows, gather(features, indices)], dim=-1)
    rows = x_matrices(offsets, module.transform) @ rows
    out = elu_dense(depthwise(rows, module.depthwise).flatten(2), module.pointwise)
    if module.position is not None:
        position = elu_dense(elu_dense(representatives, module.position[0]), module.position[1])
        out = torch.cat([position, out], dim=-1)
    return representatives, out


def pointcnn(network: PointCNN, points: Tensor) -> tuple[Tensor, Tensor | float]:
    features = None
    for level in network.levels:
        points, features = x_conv(points, features, level)
    first, second, dropout = network.dense
    return dropout(elu_dense(elu_dense(features, first), second)), 0.0


def lstm_step(inputs: Tensor, hidden: Tensor, cell: Tensor, module: nn.Module) -> tuple[Tensor, Tensor]:
    gates = linear(torch.cat([inputs, hidden], dim=-1), module.linear)
    enter, forget, candidate, leave = gates.chunk(4, dim=-1)
    cell = torch.sigmoid(forget + 1) * cell + torch.sigmoid(enter) * torch.tanh(candidate)
    return torch.sigmoid(leave) * torch.tanh(cell), cell


def attention_vector(memory: Tensor, query: Tensor, module: nn.Module) -> Tensor:
    scores = torch.tanh(linear(memory, module.memory) + linear(query, module.query).unsqueeze(2))
    weights = torch.softmax(linear(scores, module.score), dim=2)  # (B, M, T, 1)
    context = (weights * memory).sum(dim=2)
    return linear(torch.cat([query, context], dim=-1), module.combine)


def point2sequence(network: Point2Sequence, points: Tensor) -> tuple[Tensor, Tensor | float]:
    centres = points[:, :NUM_CENTRES]
    dilation = min(network.dilation, points.shape[1] // max(AREAS))
    indices = knn(centres, points, max(AREAS) * dilation)[..., ::dilation]
    offsets = gather(points, indices) - centres.unsqueeze(2)
    areas = [pooled_mlp(offsets[:, :, :size], mlp) for size, mlp in zip(AREAS, network.mlps, strict=True)]

    hidden = cell = zero = torch.zeros_like(areas[0])
    memory = []
    for area in areas:
        hidden, cell = lstm_step(area, hidden, cell, network.encoder)
        memory.append(hidden)
    previous_attention = zero
    region, _ = lstm_step(torch.cat([hidden, previous_attention], dim=-1), zero, zero, network.decoder)
    if network.region_feature == "attention":
        region = attention_vector(torch.stack(memory, dim=2), region, network.attention)

    norm, _, last = network.region
    region = dense(torch.relu(batch_norm(region, norm)), last[0], last[1])
    return pooled_mlp(torch.cat([centres, region], dim=-1), network.globals), 0.0


_FEATURES: dict[type[PointNetwork], Callable[..., tuple[Tensor, Tensor | float]]] = {
    PointNet: pointnet,
    PointNet2: pointnet2,
    DGCNN: dgcnn,
    PointCNN: pointcnn,
    Point2Sequence: point2sequence,
}
"""(B, F) or (B, P, F) features of (B, N, 3) points, and the term that the loss adds to the cross entropy."""
