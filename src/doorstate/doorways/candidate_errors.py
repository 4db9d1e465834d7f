# SPDX-License-Identifier: Apache-2.0
"""Standard errors of candidate doorways, which their score tells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

ONE_SIGMA = 0.683
"""Share of a normal distribution within one standard deviation."""


class PoseErrors(NamedTuple):
    """Standard errors of a doorway: 68 % of the errors are smaller."""

    along_m: float  # of the opening's middle, along the wall
    across_m: float
    yaw_deg: float
    width_m: float


# Score, and errors of the candidates within 0.35 m and 20 degrees of a door in the training data of doorways
# (docs/doorway-data.md).
_BY_SCORE = np.array(
    [
        (0.05, 0.276, 0.008, 0.24, 0.33),
        (0.15, 0.230, 0.010, 0.31, 0.36),
        (0.25, 0.238, 0.009, 0.29, 0.42),
        (0.35, 0.212, 0.007, 0.30, 0.42),
        (0.45, 0.128, 0.006, 0.21, 0.29),
        (0.55, 0.095, 0.006, 0.21, 0.18),
        (0.65, 0.069, 0.005, 0.18, 0.14),
        (0.75, 0.030, 0.004, 0.12, 0.07),
        (0.85, 0.015, 0.002, 0.06, 0.03),
        (0.95, 0.011, 0.002, 0.05, 0.03),
    ]
)


def candidate_errors(score: float) -> PoseErrors:
    """Return the standard errors of a candidate with a score."""
    scores, *errors = _BY_SCORE.T
    return PoseErrors(*(float(np.interp(score, scores, column)) for column in errors))
