# SPDX-License-Identifier: Apache-2.0
"""Head "frame": middle of the opening, and yaw of the wall's normal on the robot's side as a direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.clouds.normalization import Placement
from doorstate.networks.heads.shared import (
    LENGTH_WEIGHT,
    angle_error_deg,
    direction_loss,
    distance,
    plan_transform,
    quantile,
)
from doorstate.networks.heads.spec import Column, Floats, HeadSpec, Metric, States, Values

if TYPE_CHECKING:
    from torch import Tensor


def _decode(outputs: Tensor) -> Tensor:
    import torch

    return torch.cat([outputs[:, :2], outputs[:, 3:].atan2(outputs[:, 2:3])], dim=1)


def _loss(outputs: Tensor, target: Tensor) -> Tensor:
    """Return the weighted error of the position plus that of the direction, which is close to radians."""
    position = distance(outputs[:, :2], target[:, :2])
    return LENGTH_WEIGHT * position + direction_loss(outputs[:, 2:], target[:, 2:])


def _to_values(columns: Floats, placement: Placement) -> Floats:
    """Convert the position, and the yaw of the wall, which the manifest holds, to that of its normal."""
    position = columns[:, :2] - placement.centres[:, :2]
    normal = np.radians(columns[:, 2] + 90)
    return np.column_stack([position / placement.scale_m, np.arctan2(np.sin(normal), np.cos(normal))])


def _to_columns(values: Floats, placement: Placement) -> Floats:
    position = values[:, :2] * placement.scale_m + placement.centres[:, :2]
    return np.column_stack([position, (np.degrees(values[:, 2]) + 90) % 360 - 180])


def _augment(target: Values, draw: AugmentationDraw) -> NDArray[np.floating]:
    """Move and turn the frame with the points."""
    plan, _ = plan_transform(draw)
    normal = np.stack([np.cos(target[:, 2]), np.sin(target[:, 2])], axis=1)
    position, normal = ((plan @ vector[:, :, None])[:, :, 0] for vector in (target[:, :2], normal))
    return np.column_stack([position + draw.shift[:, 0, :2], np.arctan2(normal[:, 1], normal[:, 0])])


def _position_error_m(columns: Floats, truth: Floats) -> Floats:
    return np.hypot(columns[:, 0] - truth[:, 0], columns[:, 1] - truth[:, 1])


def _position_error_median(columns: Floats, truth: Floats, states: States) -> float:
    return quantile(_position_error_m(columns, truth), 0.5)


def _position_error_p90(columns: Floats, truth: Floats, states: States) -> float:
    return quantile(_position_error_m(columns, truth), 0.9)


def _yaw_error_median(columns: Floats, truth: Floats, states: States) -> float:
    return quantile(angle_error_deg(columns[:, 2], truth[:, 2]), 0.5)


FRAME_HEAD = HeadSpec(
    name="frame",
    description=(
        "x, y of the opening's middle, normalised as the points are, and the yaw in radians of the wall's normal "
        "towards the camera"
    ),
    columns=(Column("door_x_m", "m"), Column("door_y_m", "m"), Column("door_yaw_deg", "deg")),
    num_outputs=4,
    decode=_decode,
    loss=_loss,
    to_values=_to_values,
    to_columns=_to_columns,
    augment=_augment,
    metrics=(
        Metric("frame_position_error_median_m", "frame position: median error, m", 3, _position_error_median),
        Metric("frame_position_error_p90_m", "frame position: 90th percentile, m", 3, _position_error_p90),
        Metric("frame_yaw_error_median_deg", "frame yaw: median error, °", 1, _yaw_error_median),
    ),
)
