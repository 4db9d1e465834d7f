# SPDX-License-Identifier: Apache-2.0
"""Network of `doorstate.doorways.column_scorer`: two convolutions over cells, five along the columns."""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from doorstate.doorways.column_scorer import DEPTH_SCALE_M, END_SCALE_M, PLACE_SCALE_M, WIDTH_SCALE
from doorstate.doorways.elevation import NUM_ROWS

from .samples import NUM_FEATURES, TARGETS

_CELL_CHANNELS, _CHANNELS = 16, 32
_DILATIONS = (1, 2, 4, 2)
_RARE = -4.0  # logit: middles and ends are rare
_FOCUS, _FLOOR, _POSITIVE = 1.5, 0.02, 4.0  # of the focal loss
_PLACE_M, _WIDTH, _DEPTH_M, _END_M = 0.1, 0.15, 0.05, 0.05  # errors that cost as much as each other
_GEOMETRY_WEIGHT = 0.05
_END_REACH_M = 0.12
# Outputs and their targets.
_LOGITS = ((0, TARGETS.middle), (4, TARGETS.left), (6, TARGETS.right))
_AT_MIDDLES = (
    (1, TARGETS.place, PLACE_SCALE_M, _PLACE_M),
    (2, TARGETS.width, WIDTH_SCALE, _WIDTH),
    (3, TARGETS.depth, DEPTH_SCALE_M, _DEPTH_M),
)
_AT_ENDS = ((5, TARGETS.left_place), (7, TARGETS.right_place))
_NUM_OUTPUTS = 8


class ColumnNetwork(nn.Module):
    """Outputs (W, columns, 8) from cells (W, columns, rows, 7) and columns (W, columns, 2)."""

    def __init__(self) -> None:
        super().__init__()
        self.cells = nn.ModuleList(
            [
                nn.Conv2d(size, _CELL_CHANNELS, 3, padding=1, stride=(1, 2))
                for size in (NUM_FEATURES, _CELL_CHANNELS)
            ]
        )
        self.mix = nn.Conv1d(_CELL_CHANNELS * NUM_ROWS // 4 + 2, _CHANNELS, 1)
        self.along = nn.ModuleList(
            [
                nn.Conv1d(_CHANNELS, _CHANNELS, 5, padding=2 * dilation, dilation=dilation)
                for dilation in _DILATIONS
            ]
        )
        self.last = nn.Conv1d(_CHANNELS, _NUM_OUTPUTS, 1)
        assert self.last.bias is not None
        nn.init.zeros_(self.last.bias)
        with torch.no_grad():
            self.last.bias[[output for output, _ in _LOGITS]] = _RARE

    def forward(self, cells: Tensor, columns: Tensor) -> Tensor:
        """Return the outputs."""
        features = cells.permute(0, 3, 1, 2)
        for layer in self.cells:
            features = layer(features).relu()
        stacked = features.permute(0, 1, 3, 2).flatten(1, 2)  # (W, channels * rows, columns)
        mixed = self.mix(torch.cat([stacked, columns.transpose(1, 2)], dim=1)).relu()
        for layer in self.along:
            mixed = mixed + layer(mixed).relu()
        return cast(Tensor, self.last(mixed)).transpose(1, 2)


def loss(outputs: Tensor, targets: Tensor) -> Tensor:
    """Return the loss of a batch: focal for middles and ends, absolute errors where a doorway is.

    Args:
        outputs: (W, columns, 8).
        targets: (W, columns, 10), as `samples.Targets`.
    """
    weight = targets[..., TARGETS.weight]
    total = outputs.new_zeros(())
    for output, target in _LOGITS:
        total = total + _focal(outputs[..., output], targets[..., target], weight)
    near = targets[..., TARGETS.is_near] * weight
    geometry = outputs.new_zeros(())
    for output, target, scale, unit in _AT_MIDDLES:
        error = (outputs[..., output] * scale - targets[..., target]).abs()
        geometry = geometry + (error / unit * near).sum()
    has_door = targets[..., TARGETS.is_near].amax(dim=1, keepdim=True)
    for output, target in _AT_ENDS:
        place = targets[..., target]
        at_end = (place.abs() < _END_REACH_M) & (targets[..., target - 1] > 0)
        error = (outputs[..., output] * END_SCALE_M - place).abs()
        geometry = geometry + (error / _END_M * at_end * has_door * weight).sum()
    return total + _GEOMETRY_WEIGHT * geometry / len(outputs)


def _focal(logits: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    error = (logits.detach().sigmoid() - target).abs()
    entropy = nn.functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    focus = (error**_FOCUS + _FLOOR) * (1 + _POSITIVE * target)
    return (entropy * focus * weight).sum() / len(logits)
