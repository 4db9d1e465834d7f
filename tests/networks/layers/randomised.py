# SPDX-License-Identifier: Apache-2.0
"""Layers whose scales and statistics are not those of an untrained layer."""

from __future__ import annotations

import torch
from torch import nn

from doorstate.networks.layers.batch_norm import RowBatchNorm


def randomised(module: nn.Module) -> nn.Module:
    """Scales of both signs and running statistics that are not those of an untrained layer."""
    for norm in module.modules():
        if isinstance(norm, RowBatchNorm):
            torch.nn.init.uniform_(norm.weight, -1, 1)
            torch.nn.init.uniform_(norm.bias, -0.5, 0.5)
            torch.nn.init.uniform_(norm.running_mean, -0.5, 0.5)
            torch.nn.init.uniform_(norm.running_var, 0.5, 2)
    for linear in module.modules():
        if isinstance(linear, nn.Linear) and linear.bias is not None:
            torch.nn.init.uniform_(linear.bias, -1, 1)
    return module
