# SPDX-License-Identifier: Apache-2.0
"""Intervals of 95 %: Wilson's of a share, with and without dependent samples, and a cluster bootstrap of F1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from statsmodels.stats.proportion import proportion_confint

from doorstate.evaluation.metrics import Floats, confusion_cells, precision_recall_f1
from doorstate.types import PREDICTED_LABELS, STATES

Interval = tuple[float, float]

CONFIDENCE = 0.95
RESAMPLES = 2000
_UNDEFINED = (float("nan"), float("nan"))


def bounds(name: str, interval: Interval) -> dict[str, float]:
    """Return an interval as the two columns `<name>_low` and `<name>_high`."""
    return {f"{name}_low": interval[0], f"{name}_high": interval[1]}


def wilson_interval(successes: float, trials: float) -> Interval:
    """Return the Wilson score interval of a proportion (Wilson 1927); NaN without trials."""
    if trials == 0:
        return _UNDEFINED
    low, high = proportion_confint(successes, trials, alpha=1 - CONFIDENCE, method="wilson")
    # The ends are exact where rounding is not.
    return float(low) if successes else 0.0, float(high) if successes < trials else 1.0


def grouped_interval(correct: NDArray[np.bool_], groups: Sequence[str] | pd.Series[str]) -> Interval:
    """Return the Wilson interval of a share as if the samples of a group were copies of one.

    Trials are Kish's effective number, (sum m)^2 / sum m^2 of the groups' sizes m: his design effect at an
    intraclass correlation of 1 (Kish 1965). Independent samples have `wilson_interval`; the truth lies between.

    Args:
        correct: (N,) outcomes.
        groups: N names.
    """
    if len(correct) == 0:
        return _UNDEFINED
    _, sizes = np.unique(np.asarray(groups, dtype=object), return_counts=True)
    trials = float(sizes.sum() ** 2 / (sizes**2).sum())
    return wilson_interval(float(correct.mean()) * trials, trials)


@dataclass(frozen=True)
class F1Intervals:
    """Percentile bootstrap intervals of F1: one per state, and of their mean."""

    per_state: tuple[Interval, ...]
    macro: Interval


def bootstrap_f1(
    predictions: pd.DataFrame,
    clusters: Sequence[str] | pd.Series[str],
    generator: np.random.Generator,
    resamples: int = RESAMPLES,
) -> F1Intervals:
    """Bootstrap F1 by drawing whole clusters with replacement (percentile method).

    The three states of one pose share position and heading, so their outcomes depend on each other: a pose is
    drawn as a whole. Clusters with the same confusion matrix are interchangeable, so one multinomial over the
    few distinct matrices is the same distribution as drawing thousands of clusters one by one.

    Args:
        predictions: N rows with columns `state` and `predicted`.
        clusters: N names; samples of one name are drawn together.
        generator: source of the draws.
        resamples: number of bootstrap samples.
    """
    states, labels = len(STATES), len(PREDICTED_LABELS)
    if len(predictions) == 0:
        return F1Intervals((_UNDEFINED,) * states, _UNDEFINED)
    _, cluster = np.unique(np.asarray(clusters, dtype=object), return_inverse=True)
    cells = np.zeros((cluster.max() + 1, states * labels), dtype=np.int64)
    np.add.at(cells, (cluster, confusion_cells(predictions)), 1)
    patterns, counts = np.unique(cells, axis=0, return_counts=True)
    draws = generator.multinomial(len(cells), counts / len(cells), size=resamples)
    resampled = precision_recall_f1((draws @ patterns).reshape(resamples, states, labels))  # (R, 3, 4)
    return F1Intervals(
        tuple(_percentile_interval(values) for values in resampled.f1.T),
        _percentile_interval(resampled.macro.f1),
    )


def bootstrap_mean(
    values: NDArray[Any],
    clusters: Sequence[str] | pd.Series[Any],
    generator: np.random.Generator,
    resamples: int = RESAMPLES,
) -> Interval:
    """Bootstrap the mean of N values by drawing whole clusters with replacement (percentile method).

    Args:
        values: (N,) numbers.
        clusters: N names; values of one name are drawn together.
        generator: source of the draws.
        resamples: number of bootstrap samples.
    """
    if len(values) == 0:
        return _UNDEFINED
    _, cluster = np.unique(np.asarray(clusters, dtype=object), return_inverse=True)
    sums, sizes = np.bincount(cluster, values), np.bincount(cluster)
    draws = generator.multinomial(len(sizes), np.full(len(sizes), 1 / len(sizes)), size=resamples)
    return _percentile_interval((draws @ sums) / (draws @ sizes))


def _percentile_interval(values: NDArray[Any] | Floats) -> Interval:
    defined = values[~np.isnan(values)]  # the F1 of a state is undefined in a resample without it
    if len(defined) == 0:
        return _UNDEFINED
    low, high = np.quantile(defined, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)
