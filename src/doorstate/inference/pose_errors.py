# SPDX-License-Identifier: Apache-2.0
"""Pose of a door from a candidate and a network's correction of it, each weighted by its error.

The finder places a door that it is sure of within 1 cm, and others within 20 cm; a network is off by a few centimetres
whatever the score. So the correction counts by the variances of both. Errors of the network are measured on validation
doors (`WeightsCard.errors`); without them its correction counts in full.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from doorstate.doorways.candidate_errors import PoseErrors, candidate_errors
from doorstate.networks.card import HeadErrors


class Correction(NamedTuple):
    """Correction of a candidate, in the doorway's frame."""

    along_m: float
    across_m: float
    yaw_deg: float
    width_m: float


class Corrected(NamedTuple):
    """Correction of a candidate as it counts, and the standard errors of the corrected doorway."""

    correction: Correction
    errors: PoseErrors


def weigh_correction(correction: Correction, score: float, network: HeadErrors | None) -> Corrected:
    """Return the correction that combines a candidate and a network, and the errors that are left.

    A correction that is larger than the errors of both explain makes the errors larger in proportion.

    Args:
        correction: correction by the network.
        score: score of the candidate.
        network: errors of the network; None: not measured.
    """
    candidate = candidate_errors(score)
    if network is None:
        return Corrected(correction, candidate)
    own = PoseErrors(network.along_m, network.across_m, network.yaw_deg, network.width_m)
    spreads = [math.hypot(*pair) for pair in zip(candidate, own, strict=True)]
    weights = [(error / spread) ** 2 for error, spread in zip(candidate, spreads, strict=True)]
    ratios = [value / spread for value, spread in zip(correction, spreads, strict=True)]
    growth = max(1.0, math.sqrt(sum(ratio**2 for ratio in ratios) / len(ratios)))
    return Corrected(
        Correction(*(weight * value for weight, value in zip(weights, correction, strict=True))),
        PoseErrors(*(growth * math.sqrt(weight) * error for weight, error in zip(weights, own, strict=True))),
    )
