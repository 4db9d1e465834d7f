# SPDX-License-Identifier: Apache-2.0
"""Head "hinge": side of the hinge, left or right as seen from the camera."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.networks.heads.shared import binary_cross_entropy, mean, plan_transform, sigmoid
from doorstate.networks.heads.spec import Column, Floats, HeadSpec, Metric, States, Values
from doorstate.types import DECISION_THRESHOLD


def _parse(side: str) -> float:
    return {"left": 1.0, "right": 0.0}.get(side, math.nan)


def _augment(target: Values, draw: AugmentationDraw) -> NDArray[np.floating]:
    """Swap the sides of mirrored doors."""
    _, determinant = plan_transform(draw)
    return np.where(determinant[:, None] < 0, 1 - target, target)


def _is_correct(columns: Floats, truth: Floats) -> Floats:
    """Return (M,) 1 where the side is correct, 0 where it is wrong, NaN where one of the two is missing."""
    missing = np.isnan(columns) | np.isnan(truth)
    return np.where(missing, math.nan, (columns >= DECISION_THRESHOLD) == (truth == 1))[:, 0]


def _accuracy(columns: Floats, truth: Floats, states: States) -> float:
    return mean(_is_correct(columns, truth))


def _accuracy_not_closed(columns: Floats, truth: Floats, states: States) -> float:
    return mean(_is_correct(columns, truth)[(states == "semi_open") | (states == "open")])


HINGE_HEAD = HeadSpec(
    name="hinge",
    description="probability that the hinge is on the left",
    columns=(Column("p_hinge_left", "", manifest="hinge", parse=_parse),),
    num_outputs=1,
    decode=sigmoid,
    loss=binary_cross_entropy,
    augment=_augment,
    metrics=(
        Metric("hinge_accuracy", "hinge side: accuracy", 4, _accuracy),
        Metric("hinge_accuracy_not_closed", "hinge side, not closed: accuracy", 4, _accuracy_not_closed),
    ),
)
