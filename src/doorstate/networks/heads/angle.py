# SPDX-License-Identifier: Apache-2.0
"""Head "angle": opening angle, predicted as a direction in the plane so that the loss is continuous."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from doorstate.clouds.normalization import Placement
from doorstate.networks.heads.shared import angle_error_deg, direction_loss, mean
from doorstate.networks.heads.spec import Column, Floats, HeadSpec, Metric, States

if TYPE_CHECKING:
    from torch import Tensor


def _decode(outputs: Tensor) -> Tensor:
    return outputs[:, 1].atan2(outputs[:, 0]).unsqueeze(1)


def _to_values(columns: Floats, placement: Placement) -> Floats:
    return np.radians(columns)


def _to_columns(values: Floats, placement: Placement) -> Floats:
    """Convert to degrees and to the nearest angle that a door can have, 0 to 180: a direction can be any."""
    angle_deg = np.degrees(values)
    return np.where(angle_deg < 0, np.where(angle_deg < -90, 180.0, 0.0), angle_deg)


def _error_semi_open(columns: Floats, truth: Floats, states: States) -> float:
    return mean(angle_error_deg(columns, truth)[states == "semi_open", 0])


def _error_open(columns: Floats, truth: Floats, states: States) -> float:
    return mean(angle_error_deg(columns, truth)[states == "open", 0])


ANGLE_HEAD = HeadSpec(
    name="angle",
    description="opening angle in radians",
    columns=(Column("opening_angle_deg", "deg"),),
    num_outputs=2,
    decode=_decode,
    loss=direction_loss,
    to_values=_to_values,
    to_columns=_to_columns,
    metrics=(
        Metric("angle_error_semi_open_deg", "opening angle, semi-open: mean error, °", 1, _error_semi_open),
        Metric("angle_error_open_deg", "opening angle, open: mean error, °", 1, _error_open),
    ),
)
