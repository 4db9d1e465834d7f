# SPDX-License-Identifier: Apache-2.0
"""Check of probabilities, for everything that reads them: one that is not finite would stay in a filter for ever."""

from __future__ import annotations

import math
from collections.abc import Sequence

SUM_TOLERANCE = 1e-3  # of probabilities in float16 or float32, from 1


def is_probability(value: float) -> bool:
    """Return True for a number from 0 to 1, rounding aside."""
    return -SUM_TOLERANCE <= value <= 1 + SUM_TOLERANCE


def are_probabilities(values: Sequence[float]) -> bool:
    """Return True for probabilities that sum to one."""
    return all(map(is_probability, values)) and math.isclose(sum(values), 1, abs_tol=SUM_TOLERANCE)
