# SPDX-License-Identifier: Apache-2.0
"""Time and money of the published runs on other machines, reckoned from the seconds that they took."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from typing import NamedTuple

from .published import comparison

HOUR_S = 3600


class Cost(NamedTuple):
    """A machine, and the number of runs that it does at the same time."""

    places: int
    hours: float  # until the last run is done
    run_hours: float  # of all runs together


def reckon_cost(experiment: str, places: int, speedup: float = 1.0) -> Cost:
    """Return the time of an experiment's trainings if each has a place of its own.

    Args:
        experiment: name in `results/`.
        places: runs at the same time: cores, or GPUs.
        speedup: ratio of a place's speed to one of the cores that trained the published runs.
    """
    runs = [run for run in comparison(experiment).runs if len(run.log)]
    # As if each had one thread: two threads take half as long at best.
    hours = [
        run.metric("seconds") * int(run.environment.get("threads", 1)) / HOUR_S / speedup for run in runs
    ]
    return Cost(places, schedule_length(hours, places), sum(hours))


def schedule_length(durations: Iterable[float], places: int) -> float:
    """Return the time until all runs are done, started in their order, each where a place is free first."""
    free = [0.0] * places
    for duration in durations:
        heapq.heapreplace(free, free[0] + duration)
    return max(free)
