# SPDX-License-Identifier: Apache-2.0
"""ReLU(W x + b) of coordinates, in pieces, without keeping the values before the ReLU.

The derivative of the ReLU is the sign of its output, so backward needs only the output.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional

from doorstate.networks.kernels.pieces import pieces
from doorstate.networks.kernels.precision import autocast_type, full_precision, wants_gradient


def linear_relu(rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Return ReLU(W x + b) of coordinates, computed in their own precision and rounded once to the type of autocast.

    Args:
        rows: (R, C) coordinates.
        weight: (C', C).
        bias: (C',).

    Returns:
        (R, C').
    """
    kind = autocast_type(rows)
    with full_precision(rows):
        if not wants_gradient(rows, weight):
            return functional.linear(rows, weight, bias).relu_().to(kind)
        return _relu_linear(rows, weight, bias, kind)


class _LinearReLU(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, rows: Tensor, weight: Tensor, bias: Tensor, kind: torch.dtype) -> Tensor:
        out = rows.new_empty(len(rows), len(weight), dtype=kind)
        for piece in pieces(len(rows), len(weight), rows):
            out[piece] = torch.addmm(bias, rows[piece], weight.T).relu_()
        ctx.save_for_backward(rows, weight, out)
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        rows, weight, out = ctx.saved_tensors
        weight_grad, bias_grad = torch.zeros_like(weight), weight.new_zeros(len(weight))
        rows_grad = torch.empty_like(rows) if ctx.needs_input_grad[0] else None
        for piece in pieces(len(rows), len(weight), rows):
            inner = (grad[piece] * out[piece].sign()).to(rows.dtype)
            weight_grad += inner.T @ rows[piece]
            bias_grad += inner.sum(0)
            if rows_grad is not None:
                torch.mm(inner, weight, out=rows_grad[piece])
        return rows_grad, weight_grad, bias_grad, None


_relu_linear: Callable[[Tensor, Tensor, Tensor, torch.dtype], Tensor] = _LinearReLU.apply
