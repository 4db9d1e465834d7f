# SPDX-License-Identifier: Apache-2.0
"""How long a comparison will still take, from what its epochs took so far."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from statistics import fmean

from doorstate.training.comparison import RunSpec
from doorstate.training.recipes import Recipe, Resolution, resolution_of_epoch

_Known = Mapping[Resolution, Sequence[float]]


def eta_seconds(runs: Sequence[RunSpec], recipes: Mapping[str, Recipe], num_points: int) -> float | None:
    """Seconds that one job after the other would need for what is left; None before the first epoch is done.

    Args:
        runs: finished, begun and waiting.
        recipes: by network.
        num_points: of each cloud at the end of a run.
    """
    known: dict[str, dict[Resolution, list[float]]] = defaultdict(lambda: defaultdict(list))
    for run in runs:
        for line in run.folder.read_log():
            resolution = Resolution(int(line["points"]), float(line.get("centres", 1)))
            known[run.method][resolution].append(float(line["seconds"]))
    if not known:
        return None
    left = 0.0
    for run in runs:
        if run.folder.finished or run.method not in recipes:  # rules take seconds
            continue
        recipe, done = recipes[run.method], run.folder.read_position()
        # Another network's epochs are a better guess than none.
        own = known[run.method] if run.method in known else next(iter(known.values()))
        for epoch in range(int(done), recipe.epochs):
            share = 1 - (done - epoch) if epoch < done else 1.0
            left += share * _epoch_seconds(own, resolution_of_epoch(recipe, epoch, num_points))
    return left


def _epoch_seconds(known: _Known, wanted: Resolution) -> float:
    """Mean of the epochs at this resolution, or at the nearest, in proportion to points and centres."""
    nearest = min(known, key=lambda each: abs(_size(each) - _size(wanted)))
    return fmean(known[nearest]) * _size(wanted) / _size(nearest)


def _size(resolution: Resolution) -> float:
    return resolution.points * resolution.centres
