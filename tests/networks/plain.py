# SPDX-License-Identifier: Apache-2.0
"""Slow, literal twins of the layers; the oracles of the tests."""

from __future__ import annotations

import copy
from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional


def knn(query: Tensor, points: Tensor, k: int) -> Tensor:
    """Sorted by distance, ties by index."""
    rows = [
        [[((q - p) ** 2).sum() for p in cloud] for q in queries]
        for queries, cloud in zip(query, points, strict=True)
    ]
    return torch.tensor(rows).argsort(dim=-1, stable=True)[..., :k]


def ball_query(centres: Tensor, points: Tensor, radius: float, num_samples: int) -> Tensor:
    """First hits in index order, padded with the first."""
    ball_indices = torch.zeros(*centres.shape[:2], num_samples, dtype=torch.int64)
    for b in range(centres.shape[0]):
        for m, centre in enumerate(centres[b]):
            hits = [j for j, point in enumerate(points[b]) if ((point - centre) ** 2).sum() < radius**2]
            hits = (hits + [hits[0]] * num_samples)[:num_samples]
            ball_indices[b, m] = torch.tensor(hits)
    return ball_indices


def gather(values: Tensor, indices: Tensor) -> Tensor:
    """Rows of each cloud by advanced indexing."""
    return torch.stack([cloud[index] for cloud, index in zip(values, indices, strict=True)])


def batch_norm(rows: Tensor, norm: nn.BatchNorm1d) -> Tensor:
    """Batch normalisation with the batch's statistics, or the running ones in evaluation; changes nothing."""
    flat = rows.reshape(-1, rows.shape[-1])
    mean, variance = norm.running_mean, norm.running_var
    if norm.training:
        mean, variance = flat.mean(0), flat.var(0, correction=0)
    assert mean is not None
    assert variance is not None
    return (rows - mean) / torch.sqrt(variance + norm.eps) * norm.weight + norm.bias


def dense(rows: Tensor, linear: nn.Linear, norm: nn.BatchNorm1d) -> Tensor:
    """Linear, BatchNorm, ReLU."""
    return torch.relu(batch_norm(functional.linear(rows, linear.weight, linear.bias), norm))


def pooled_mlp(rows: Tensor, module: nn.Module) -> Tensor:
    """PooledMLP on rows that are already [offsets; features] of every neighbour."""
    rows = dense(rows, module.mlp.first, module.mlp.norm)
    for linear, norm, _ in module.mlp.rest:
        rows = dense(rows, linear, norm)
    return dense(rows, module.pool.linear, module.pool.norm).max(dim=-2).values


def edge_conv(features: Tensor, indices: Tensor, module: nn.Module) -> Tensor:
    """max_j LeakyReLU(BatchNorm(W [x_j - x_i; x_i])) with every edge written out."""
    neighbours = gather(features, indices)  # (B, N, k, C)
    centres = features.unsqueeze(2).expand_as(neighbours)
    edges = functional.linear(torch.cat([neighbours - centres, centres], dim=-1), module.linear.weight)
    return functional.leaky_relu(batch_norm(edges, module.norm), 0.2).max(dim=2).values


def x_conv(points: Tensor, features: Tensor | None, indices: Tensor, module: nn.Module) -> Tensor:
    """X-Conv with 2D convolutions, channels first, as its paper writes it; without the global branch."""
    k = module.k
    representatives = points[:, : indices.shape[1]]
    offsets = gather(points, indices) - representatives.unsqueeze(2)  # (B, P, K, 3)

    def elu_norm(x: Tensor, norm: nn.BatchNorm1d, activate: bool = True) -> Tensor:
        rows = x.movedim(1, -1)
        return batch_norm(functional.elu(rows) if activate else rows, norm).movedim(-1, 1)

    def depthwise(x: Tensor, weight: Tensor) -> Tensor:
        kernel = weight.permute(1, 2, 0).reshape(-1, 1, 1, weight.shape[0])  # (C * m, 1, 1, K)
        return functional.conv2d(x, kernel, groups=weight.shape[1])  # (B, C * m, P, 1)

    def squared(x: Tensor) -> Tensor:
        """(B, K * K, P, 1) to channels first with the first index of the K x K matrix as width."""
        return x.squeeze(-1).unflatten(1, (k, k)).permute(0, 2, 3, 1)

    transform = module.transform
    kernel = transform.linear.weight.unflatten(1, (k, 3)).movedim(-1, 1).unsqueeze(2)  # (K * K, 3, 1, K)
    x = elu_norm(functional.conv2d(offsets.movedim(-1, 1), kernel), transform.norm0)
    x = elu_norm(depthwise(squared(x), transform.depthwise1), transform.norm1)
    x = elu_norm(depthwise(squared(x), transform.depthwise2), transform.norm2, activate=False)
    matrices = x.squeeze(-1).movedim(1, -1).unflatten(-1, (k, k))  # (B, P, K, K)

    rows = offsets
    for linear, _, norm in module.lift:
        rows = batch_norm(functional.elu(functional.linear(rows, linear.weight)), norm)
    if features is not None:
        rows = torch.cat([rows, gather(features, indices)], dim=-1)
    rows = torch.stack([matrices[:, :, i, :, None].mul(rows).sum(2) for i in range(k)], dim=2)
    out = depthwise(rows.movedim(-1, 1), module.depthwise).squeeze(-1).movedim(1, -1)  # (B, P, C * m)
    linear, _, norm = module.pointwise
    return batch_norm(functional.elu(functional.linear(out, linear.weight)), norm)


def assert_twins(
    module: nn.Module,
    fast: Callable[[nn.Module, list[Tensor]], Tensor],
    plain: Callable[[nn.Module, list[Tensor]], Tensor],
    inputs: list[Tensor],
    dtype: torch.dtype,
) -> None:
    """Outputs and all gradients of both forms agree: to 1e-9 in float64, 1e-4 in float32."""
    tolerance = 1e-9 if dtype == torch.float64 else 1e-4
    results = []
    for form in (fast, plain):
        twin = copy.deepcopy(module).to(dtype)
        leaves = [x.detach().to(dtype).requires_grad_() for x in inputs]
        out = form(twin, leaves)
        weights = torch.linspace(-1, 1, out.numel(), dtype=dtype).view_as(out)
        (out * weights).sum().backward()
        grads = {f"input {i}": leaf.grad for i, leaf in enumerate(leaves)}
        grads |= {name: p.grad for name, p in twin.named_parameters()}
        results.append((out.detach(), {name: g for name, g in grads.items() if g is not None}))
    (fast_out, fast_grads), (plain_out, plain_grads) = results
    torch.testing.assert_close(fast_out, plain_out, rtol=tolerance, atol=tolerance)
    assert fast_grads.keys() == plain_grads.keys()
    scale = max(1.0, *(expected.abs().max().item() for expected in plain_grads.values()))
    for name, expected in plain_grads.items():
        error = (fast_grads[name] - expected).abs().max().item()
        assert error <= tolerance * scale, f"gradient of {name} is off by {error} at scale {scale}"
