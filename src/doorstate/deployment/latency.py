# SPDX-License-Identifier: Apache-2.0
"""How long a packaged predictor takes from a raw cloud to its answer."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from doorstate.deployment.predictor import Predictor
from doorstate.types import Points


def median_milliseconds(predictor: Predictor, clouds: Sequence[Points], repeats: int = 3) -> float:
    """Median over clouds and repeats, after one that warms up.

    Args:
        predictor: what to time.
        clouds: raw, as a camera gives them.
        repeats: of every cloud.
    """
    predictor(clouds[0])
    return statistics.median(predictor(cloud).milliseconds for _ in range(repeats) for cloud in clouds)
