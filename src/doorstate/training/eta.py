# SPDX-License-Identifier: Apache-2.0
"""Estimate of the time that a comparison still needs, from the durations of its finished epochs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from statistics import fmean

from doorstate.training.comparison import RunSpec
from doorstate.training.recipes import Recipe
from doorstate.training.schedules import Resolution, resolution_of_epoch

_Durations = Mapping[Resolution, Sequence[float]]  # seconds of each finished epoch


def eta_seconds(runs: Sequence[RunSpec], recipes: Mapping[str, Recipe], num_points: int) -> float | None:
    """Return the seconds that the unfinished runs need one after another; None before the first epoch is done.

    Args:
        runs: all runs of the comparison.
        recipes: recipes by network; runs of rules take seconds and are not counted.
        num_points: points of each cloud in the last epochs.
    """
    durations = _durations_by_method(runs)
    if not durations:
        return None
    # A network without a finished epoch is estimated from another network.
    default = next(iter(durations.values()))
    total = 0.0
    for run in runs:
        if run.folder.finished or run.method not in recipes:
            continue
        recipe, position = recipes[run.method], run.folder.read_position()
        epoch_durations = durations.get(run.method, default)
        for epoch in range(int(position), recipe.epochs):
            share = 1 - (position - epoch) if epoch < position else 1.0
            resolution = resolution_of_epoch(recipe, epoch, num_points)
            total += share * _epoch_seconds(epoch_durations, resolution)
    return total


def _durations_by_method(runs: Sequence[RunSpec]) -> dict[str, _Durations]:
    durations: dict[str, dict[Resolution, list[float]]] = defaultdict(lambda: defaultdict(list))
    for run in runs:
        for entry in run.folder.read_log():
            resolution = Resolution(int(entry["points"]), float(entry["centres"]))
            durations[run.method][resolution].append(float(entry["seconds"]))
    return dict(durations)


def _epoch_seconds(durations: _Durations, resolution: Resolution) -> float:
    """Return the mean duration at the nearest resolution, in proportion to points times centres."""
    nearest = min(durations, key=lambda finished: abs(_size(finished) - _size(resolution)))
    return fmean(durations[nearest]) * _size(resolution) / _size(nearest)


def _size(resolution: Resolution) -> float:
    return resolution.num_points * resolution.centre_share
