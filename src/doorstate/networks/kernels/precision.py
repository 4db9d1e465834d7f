# SPDX-License-Identifier: Apache-2.0
"""Number types under autocast: sums and coordinates keep float32, products use the type of autocast."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

import torch
from torch import Tensor


def full_precision(tensor: Tensor) -> AbstractContextManager[object]:
    """Return a context without autocast on the device of a tensor."""
    return torch.autocast(tensor.device.type, enabled=False) if _is_autocast(tensor) else nullcontext()


def at_least_float32(values: Tensor) -> Tensor:
    """Return values as float32, or as float64 if they are float64."""
    return values.to(torch.promote_types(values.dtype, torch.float32))


def autocast_type(tensor: Tensor) -> torch.dtype:
    """Return the type in which autocast would compute a product with this tensor."""
    return torch.get_autocast_dtype(tensor.device.type) if _is_autocast(tensor) else tensor.dtype


def wants_gradient(*tensors: Tensor) -> bool:
    """Return True if autograd records operations on any of the tensors."""
    return torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)


def _is_autocast(tensor: Tensor) -> bool:
    device = tensor.device.type
    return torch.amp.is_autocast_available(device) and torch.is_autocast_enabled(device)
