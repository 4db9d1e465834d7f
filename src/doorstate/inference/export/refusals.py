# SPDX-License-Identifier: Apache-2.0
"""Refusals in the graph of a network: those of a prediction, and of the gate what the sampled points show.

Only the gate sees the raw cloud. Its checks of medians and quantiles are made here on smallest and largest values, so
that the graph refuses nothing that the gate accepts. A missing share and holes cannot be seen in a sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor, nn

from doorstate.doorways.crop import DEFAULT_CROP
from doorstate.inference.backends.onnx_backend import REASONS
from doorstate.inference.gate import Gate
from doorstate.inference.validity import SUM_TOLERANCE
from doorstate.networks.card import WeightsCard
from doorstate.types import DECISION_THRESHOLD, DOOR

REFUSED = -1  # in the output `state`
_ROUNDING_M = 1e-3
_BEHIND_SHARE = 0.25  # chosen: sampling picks stray points first; an optical frame or a scan has half


class Refusals(nn.Module):
    """Number of the reason why a state is refused, 0 where it is not.

    Args:
        card: card of the weights.
        gate: limits of the sampled points, of whole clouds; None for none.
    """

    def __init__(self, card: WeightsCard, gate: Gate | None) -> None:
        super().__init__()
        self.is_crop = card.input == "doorway"
        self.max_depth_m = math.inf if card.max_depth_m is None else card.max_depth_m
        self.abstain_below = card.abstain_below
        self.gate = None if self.is_crop else gate

    def forward(self, points: Tensor, probabilities: Tensor, heads: Mapping[str, Tensor]) -> Tensor:
        """Return (B,) numbers in `REASONS`.

        Args:
            points: (B, N, 3) metres.
            probabilities: (B, 3).
            heads: (B, num_values) decoded values by head.
        """
        beyond = _outside_of_crop(points) if self.is_crop else points[:, :, :1] > self.max_depth_m
        checks = {"unusable_cloud": _unusable(points) | beyond.flatten(1).any(1)}
        if self.gate is not None:
            checks |= _gate_checks(points, self.gate)
        checks["invalid_outputs"] = _invalid(probabilities, heads)
        if DOOR in heads:
            checks["no_door"] = heads[DOOR][:, 0] < DECISION_THRESHOLD
        # In float64, as Python compares.
        checks["unsure"] = probabilities.amax(1).to(torch.float64) < self.abstain_below
        reason = torch.zeros_like(probabilities[:, 0], dtype=torch.int64)
        for code in reversed(REASONS):
            if code in checks:
                reason = torch.where(checks[code], REASONS.index(code), reason)
        return reason


def _unusable(points: Tensor) -> Tensor:
    wrong = ~points.isfinite() | (points == 0).all(2, keepdim=True)
    return wrong.flatten(1).any(1)


def _outside_of_crop(points: Tensor) -> Tensor:
    """Return the mask (B, N, 3) of coordinates outside of the box of a crop, with a hair for rounding."""
    box = DEFAULT_CROP
    lowest = torch.tensor([-box.half_width_m, -box.behind_m, box.bottom_m]) - _ROUNDING_M
    highest = torch.tensor([box.half_width_m, box.before_m, box.top_m]) + _ROUNDING_M
    return (points < lowest) | (points > highest)


def _gate_checks(points: Tensor, gate: Gate) -> dict[str, Tensor]:
    """Return (B,) results of the gate's checks by code."""
    x, y, _ = points.unbind(2)
    range_m = points.square().sum(2).sqrt()
    extent_m = points.amax(1) - points.amin(1)
    bearing = torch.atan2(y, x)
    view_deg = (bearing.amax(1) - bearing.amin(1)) * (180 / math.pi)
    return {
        "points_behind_camera": (x < 0).to(torch.float32).mean(1) > max(_BEHIND_SHARE, gate.max_behind_share),
        "too_near": range_m.amax(1) < gate.min_median_range_m,
        "too_far": range_m.amin(1) > gate.max_median_range_m,
        "too_small": torch.minimum(extent_m[:, :2].amax(1), extent_m[:, 2]) < gate.min_extent_m,
        "narrow_view": view_deg < gate.min_view_deg,
    }


def _invalid(probabilities: Tensor, heads: Mapping[str, Tensor]) -> Tensor:
    valid = ((probabilities.sum(1) - 1).abs() <= SUM_TOLERANCE) & (probabilities.amin(1) >= -SUM_TOLERANCE)
    for values in (probabilities, *heads.values()):
        valid = valid & values.isfinite().all(1)
    return ~valid
