# SPDX-License-Identifier: Apache-2.0
"""Head "widths": width of the opening, and of the free passage between leaf and jamb."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.clouds.normalization import Placement
from doorstate.networks.heads.shared import LENGTH_WEIGHT, mean, plan_transform
from doorstate.networks.heads.spec import Column, Floats, HeadSpec, Metric, States, Values

if TYPE_CHECKING:
    from torch import Tensor


def _decode(outputs: Tensor) -> Tensor:
    return outputs.clamp_min(0)


def _loss(outputs: Tensor, target: Tensor) -> Tensor:
    """Return the weighted sum of the absolute errors."""
    return LENGTH_WEIGHT * (outputs - target).abs().sum(dim=1)


def _to_values(columns: Floats, placement: Placement) -> Floats:
    return columns / placement.scale_m


def _to_columns(values: Floats, placement: Placement) -> Floats:
    return values * placement.scale_m


def _augment(target: Values, draw: AugmentationDraw) -> NDArray[np.floating]:
    """Scale the widths with the plan."""
    _, determinant = plan_transform(draw)
    return target * np.sqrt(np.abs(determinant))[:, None]


def _opening_error(columns: Floats, truth: Floats, states: States) -> float:
    return mean(np.abs(columns - truth)[:, 0])


def _passage_error(columns: Floats, truth: Floats, states: States) -> float:
    return mean(np.abs(columns - truth)[:, 1])


WIDTHS_HEAD = HeadSpec(
    name="widths",
    description="widths of the opening and of the free passage, divided by the scale of the points",
    columns=(
        Column("opening_width_m", "m"),
        Column("passable_width_m", "m"),
    ),
    num_outputs=2,
    decode=_decode,
    loss=_loss,
    to_values=_to_values,
    to_columns=_to_columns,
    augment=_augment,
    metrics=(
        Metric("opening_width_error_m", "opening width: mean error, m", 3, _opening_error),
        Metric("passable_width_error_m", "passable width: mean error, m", 3, _passage_error),
    ),
)
