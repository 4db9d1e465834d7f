# SPDX-License-Identifier: Apache-2.0
"""Number of points that a time budget allows, measured on this machine."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from doorstate.inference.predictor import Predictor
from doorstate.types import Points

BUDGET_POINTS = (256, 512, 1024, 2048, 4096)  # choices of a time budget
_REPEATS = 5  # of each choice, after one call that warms up

P = TypeVar("P", bound=Predictor)


def largest_within_budget(with_points: Callable[[int], P], max_points: int, budget_ms: float) -> P:
    """Return the predictor with the most points within the budget, or with the fewest if none is within it.

    Args:
        with_points: makes the predictor that evaluates a number of points.
        max_points: largest number of points to try.
        budget_ms: milliseconds from a raw 640 x 480 cloud to a prediction.
    """
    first, *larger = [count for count in BUDGET_POINTS if count <= max_points] or [max_points]
    chosen = with_points(first)
    for count in larger:
        predictor = with_points(count)
        if median_milliseconds(predictor, [wall_and_floor()], _REPEATS) > budget_ms:
            break
        chosen = predictor
    return chosen


def median_milliseconds(predictor: Predictor, clouds: Sequence[Points], repeats: int) -> float:
    """Return the median time over clouds and repeats, after one call that warms up."""
    predictor(clouds[0])
    return statistics.median(predictor(cloud).milliseconds for _ in range(repeats) for cloud in clouds)


def wall_and_floor() -> Points:
    """Return (480, 640, 3) metres of a wall 3 m away and the floor before it, seen from 1 m above the floor."""
    # Tangents of a lens of 60 degrees.
    across, up = np.meshgrid(np.linspace(0.58, -0.58, 640), np.linspace(0.43, -0.43, 480))
    depth_m = np.minimum(3.0, 1.0 / np.maximum(-up, 0.1))
    scene: Points = (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(
        np.float32
    )
    return scene
