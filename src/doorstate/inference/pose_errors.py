# SPDX-License-Identifier: Apache-2.0
"""Standard errors of a door's place, direction and opening angle.

A network learns from crops with the finder's errors and corrects them; what is left is measured on validation doors
(`WeightsCard.errors`). A correction larger than the finder's usual error makes the errors larger in proportion.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from doorstate.doorways.finder import FINDER_ERRORS, Correction
from doorstate.networks.card import WeightsCard
from doorstate.types import DoorState

FINDER_POSITION_M = math.hypot(FINDER_ERRORS.along_m, FINDER_ERRORS.across_m)


class DoorErrors(NamedTuple):
    """Standard errors of a door; None for the angle where they are not known."""

    position_error_m: float
    yaw_error_deg: float
    angle_error_deg: float | None


def door_errors(card: WeightsCard, correction: Correction, state: DoorState) -> DoorErrors:
    """Return the standard errors of a door.

    Args:
        card: card of the weights; without measured errors, those of the finder hold for place and direction.
        correction: correction of the candidate.
        state: state of the door, on which the error of the angle depends.
    """
    measured = card.errors
    position_m = FINDER_POSITION_M if measured is None else measured.position_m
    yaw_deg = FINDER_ERRORS.yaw_deg if measured is None else measured.yaw_deg
    angle_deg = None if measured is None else measured.angle_deg.get(state)
    ratios = [value / usual for value, usual in zip(correction, FINDER_ERRORS, strict=True)]
    growth = max(1.0, math.sqrt(sum(ratio**2 for ratio in ratios) / len(ratios)))
    return DoorErrors(growth * position_m, growth * yaw_deg, angle_deg)
