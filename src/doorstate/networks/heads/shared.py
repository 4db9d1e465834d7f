# SPDX-License-Identifier: Apache-2.0
"""Losses, geometry and statistics that several heads share; torch is imported when a loss is computed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.networks.heads.spec import Floats

if TYPE_CHECKING:
    from torch import Tensor


LENGTH_WEIGHT = 3.0  # of a length in the network's unit, in losses: whole clouds have units of 3 m


def sigmoid(outputs: Tensor) -> Tensor:
    """Decode logits to probabilities."""
    return outputs.sigmoid()


def binary_cross_entropy(outputs: Tensor, target: Tensor) -> Tensor:
    """Return the (B,) losses of (B, 1) logits against (B, 1) targets of 0 or 1."""
    from torch.nn import functional

    return functional.binary_cross_entropy_with_logits(outputs, target, reduction="none").squeeze(1)


def distance(outputs: Tensor, target: Tensor) -> Tensor:
    """Return (B,) Euclidean distances; squares would be dominated by the wrong side of a symmetric door."""
    from torch.linalg import vector_norm

    result: Tensor = vector_norm(outputs - target, dim=1)
    return result


def direction_loss(outputs: Tensor, angle_rad: Tensor) -> Tensor:
    """Return (B,) distances of (B, 2) outputs to the unit vectors of (B, 1) angles: continuous at a full turn."""
    import torch

    return distance(outputs, torch.cat([angle_rad.cos(), angle_rad.sin()], dim=1))


def plan_transform(draw: AugmentationDraw) -> tuple[Floats, Floats]:
    """Return the (B, 2, 2) change of x and y, and its (B,) determinant; a tilt moves a door by less than its leaf."""
    plan = draw.linear[:, :2, :2].astype(np.float64)
    return plan, np.linalg.det(plan)


def angle_error_deg(degrees: Floats, truth_deg: Floats) -> Floats:
    """Return absolute differences of angles, 0 to 180 degrees."""
    return np.abs((degrees - truth_deg + 180) % 360 - 180)


def mean(values: Floats) -> float:
    """Return the mean of the values that are not NaN, NaN if there are none."""
    valid = values[~np.isnan(values)]
    return float(valid.mean()) if len(valid) else math.nan


def quantile(values: Floats, share: float) -> float:
    """Return a quantile of the values that are not NaN, NaN if there are none."""
    valid = values[~np.isnan(values)]
    return float(np.quantile(valid, share)) if len(valid) else math.nan
