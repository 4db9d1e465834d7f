# SPDX-License-Identifier: Apache-2.0
"""Batch normalisation of the channels of rows, and its exact shortcuts after a linear layer.

After z = W x + b the bias cancels against the batch's mean: it may be left out and only enters the running mean.
And z has the mean W m + b and the variance diag(W S W^T), where m and S are mean and covariance of x: the statistics of
the batch follow before any output is computed, and the normalisation folds into W and b, as it does in evaluation.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.networks.kernels.linear_norm_max import linear_norm_max
from doorstate.networks.kernels.max_over_points import max_over_points
from doorstate.networks.kernels.precision import full_precision
from doorstate.networks.kernels.ranks import moments_over_ranks
from doorstate.networks.layers.rank_norm import normalize_over_ranks, update_running


class RowBatchNorm(nn.BatchNorm1d):
    """Batch normalisation of (..., C) rows over all leading axes."""

    num_ranks = 1
    """Number of processes that share the batch; each has equally many rows of it."""
    momentum: float
    running_mean: Tensor
    running_var: Tensor
    num_batches_tracked: Tensor

    def forward(self, rows: Tensor) -> Tensor:
        if self.training and self.num_ranks > 1:
            return self._normalize_over_ranks(rows)
        return super().forward(rows.reshape(-1, self.num_features)).view(rows.shape)

    def after_linear(self, linear: nn.Linear, rows: Tensor) -> Tensor:
        """Normalise the outputs of a linear layer on rows."""
        if not self.training:
            weight, bias = self.fold(linear)
            return functional.linear(rows, weight, bias)
        outputs = functional.linear(rows, linear.weight)
        return self(outputs) if linear.bias is None else self.add_bias_and_normalize(outputs, linear.bias)

    def max_after_linear(self, linear: nn.Linear, groups: Tensor) -> Tensor:
        """Return the maximum over the points of the normalised outputs of a linear layer; for training.

        Args:
            linear: layer with a bias.
            groups: (G, K, C) points of G neighbourhoods.

        Returns:
            (G, C').
        """
        if self.num_ranks > 1:
            outputs = functional.linear(groups, linear.weight)
            return max_over_points(self.add_bias_and_normalize(outputs, linear.bias))
        shift = self.bias + 0 * linear.bias  # gives the bias its gradient, which is zero
        largest, mean, variance = linear_norm_max(groups, linear.weight, self.weight, shift, self.eps)
        update_running(self, mean + linear.bias, variance, count=groups.shape[0] * groups.shape[1])
        return largest

    def add_bias_and_normalize(self, rows: Tensor, bias: Tensor) -> Tensor:
        """Normalise rows + bias in training; only the running mean depends on the bias, whose gradient is zero."""
        if self.num_ranks > 1:
            return self._normalize_over_ranks(rows, bias)
        running_mean = self.running_mean.clone()  # torch keeps it for the backward pass: it must not change
        normalized = functional.batch_norm(
            rows.reshape(-1, self.num_features),
            running_mean,
            self.running_var,
            self.weight,
            self.bias + 0 * bias,
            training=True,
            momentum=self.momentum,
            eps=self.eps,
        )
        with torch.no_grad():
            self.num_batches_tracked += 1
            torch.add(running_mean, bias, alpha=self.momentum, out=self.running_mean)
        return normalized.view(rows.shape)

    def fold(
        self,
        linear: nn.Linear,
        moments: tuple[Tensor, Tensor] | None = None,
        count: int = 0,
        dtype: torch.dtype | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Fold the normalisation into the linear layer before it.

        Args:
            linear: layer before the normalisation.
            moments: (C,) mean and (C, C) covariance of the batch's inputs; None takes the running statistics.
            count: number of inputs behind the moments.
            dtype: type to which the weight will be rounded; the mean of the outputs is then computed with rounded
                weights, so that it still cancels if the inputs are far from zero.

        Returns:
            (C', C) weight and (C',) bias of the equivalent linear layer, at least float32.
        """
        weight = linear.weight
        bias = torch.zeros_like(self.bias) if linear.bias is None else linear.bias
        with full_precision(weight):
            if moments is None:
                scale = self.weight * torch.rsqrt(self.running_var + self.eps)
                return weight * scale.unsqueeze(1), self.bias + scale * (bias - self.running_mean)
            mean, covariance = moments if self.num_ranks == 1 else moments_over_ranks(*moments)
            variance = ((weight @ covariance) * weight).sum(1).clamp_min(0)
            update_running(self, weight @ mean + bias, variance, count * self.num_ranks)
            scaled = weight * (self.weight * torch.rsqrt(variance + self.eps)).unsqueeze(1)
            scaled = scaled if dtype is None else scaled.to(dtype).to(scaled.dtype)
            return scaled, self.bias - scaled @ mean + 0 * bias  # the bias cancels: its gradient is zero

    def _normalize_over_ranks(self, rows: Tensor, bias: Tensor | None = None) -> Tensor:
        flat = rows.reshape(-1, self.num_features)
        return normalize_over_ranks(self, flat, self.num_ranks, bias).view(rows.shape)


def set_batchnorm(network: nn.Module, eps: float | None = None, momentum: float | None = None) -> None:
    """Change epsilon or momentum of every batch normalisation in a network; None keeps the current value.

    Args:
        network: any module.
        eps: added to the variance; the TensorFlow originals use 1e-3.
        momentum: weight of the newest batch in the running statistics, 1 - (TensorFlow's decay).
    """
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            module.eps = module.eps if eps is None else eps
            module.momentum = module.momentum if momentum is None else momentum
