# SPDX-License-Identifier: Apache-2.0
"""What is counted: confusion matrices, their ratios, intervals around them, a paired test between methods.

A ratio whose denominator is zero is undefined, hence NaN, never a silent zero. Labels: `DoorState` values,
and one more for no answer, which only a prediction can be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binomtest, norm
from sklearn import metrics as sklearn_metrics

from doorstate.types import PREDICTED_LABELS, STATES, Indices

Floats = NDArray[np.float64]
Interval = tuple[float, float]

CONFIDENCE = 0.95


def confusion_matrix(true: Indices, predicted: Indices) -> Indices:
    """Count samples by true state (rows) and answer (columns).

    Args:
        true: (N,) labels, may be empty.
        predicted: (N,) labels, or 3 for no answer.

    Returns:
        (3, 4) counts in the order of `STATES` and `PREDICTED_LABELS`.
    """
    if len(true) == 0:  # scikit-learn refuses an empty input
        return np.zeros((len(STATES), len(PREDICTED_LABELS)), dtype=np.int64)
    counts: Indices = sklearn_metrics.confusion_matrix(
        true, predicted, labels=np.arange(len(PREDICTED_LABELS))
    )
    return counts[: len(STATES)]


def ratio(numerator: ArrayLike, denominator: ArrayLike) -> Floats:
    """Divide element by element; NaN where the denominator is zero."""
    top, bottom = np.broadcast_arrays(np.asarray(numerator, float), np.asarray(denominator, float))
    quotient: Floats = np.divide(top, bottom, out=np.full(top.shape, np.nan), where=bottom != 0)
    return quotient


@dataclass(frozen=True, eq=False)
class Scores:
    """Precision, recall and F1: arrays (..., 3) with one value a state, or (...) as means over them."""

    precision: Floats
    recall: Floats
    f1: Floats

    @property
    def macro(self) -> Scores:
        """Means over the states; NaN where a state is undefined."""
        ratios = (self.precision, self.recall, self.f1)
        return Scores(*(np.asarray(values.mean(axis=-1)) for values in ratios))


def scores(confusion: NDArray[Any]) -> Scores:
    """Compute precision, recall and F1 of each state; no answer is a miss, and no false alarm.

    recall = TP / (TP + FN), precision = TP / (TP + FP), F1 = 2 TP / (2 TP + FP + FN): the standard
    definitions. The formulas printed in Kaleci & Turgut 2021 have the first two denominators swapped; the
    words around them describe the standard ones.

    Args:
        confusion: (..., 3, 4) counts, rows true, columns answers.
    """
    hits = np.diagonal(confusion, axis1=-2, axis2=-1)  # (..., 3)
    true_count = confusion.sum(axis=-1)
    predicted_count = confusion[..., : len(STATES)].sum(axis=-2)
    return Scores(
        precision=ratio(hits, predicted_count),
        recall=ratio(hits, true_count),
        f1=ratio(2 * hits, true_count + predicted_count),
    )


def accuracy(confusion: NDArray[Any]) -> float:
    """Share of samples on the diagonal of a (3, 4) confusion matrix."""
    return float(ratio(np.trace(confusion), confusion.sum()))


def wilson_interval(successes: float, trials: float) -> Interval:
    """Give the 95 % Wilson score interval of a proportion; NaN where there were no trials (Wilson 1927)."""
    if trials == 0:
        return float("nan"), float("nan")
    share, z = successes / trials, float(norm.ppf((1 + CONFIDENCE) / 2))
    middle, scale = share + z * z / (2 * trials), 1 + z * z / trials
    half = z * math.sqrt(share * (1 - share) / trials + (z / (2 * trials)) ** 2)
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def grouped_interval(right: NDArray[np.bool_], groups: Sequence[str]) -> Interval:
    """Give the 95 % Wilson interval of a share when samples of one group say no more than one of them would.

    Trials are Kish's effective number, (sum m)^2 / sum m^2 of the groups' sizes m: his design effect at an
    intraclass correlation of 1 (Kish 1965). Independent samples have `wilson_interval`; the truth lies between.

    Args:
        right: (N,) what is counted.
        groups: N names.
    """
    if len(right) == 0:
        return wilson_interval(0, 0)
    _, sizes = np.unique(np.asarray(groups), return_counts=True)
    trials = float(sizes.sum() ** 2 / (sizes**2).sum())
    return wilson_interval(float(right.mean()) * trials, trials)


@dataclass(frozen=True)
class F1Intervals:
    """Percentile bootstrap intervals of F1: one per state, and of their mean."""

    per_state: tuple[Interval, ...]
    macro: Interval


def bootstrap_f1(
    true: Indices,
    predicted: Indices,
    clusters: Sequence[str],
    generator: np.random.Generator,
    resamples: int = 2000,
) -> F1Intervals:
    """Bootstrap F1 by drawing whole clusters with replacement (percentile method, 95 %).

    The three states of one pose share position and heading, so their outcomes depend on each other: a pose is
    drawn as a whole. Clusters with the same confusion matrix are interchangeable, so one multinomial over the
    few distinct matrices is the same distribution as drawing thousands of clusters one by one.

    Args:
        true: (N,) labels.
        predicted: (N,) labels.
        clusters: N names; samples of one name are drawn together.
        generator: source of the draws.
        resamples: number of bootstrap samples.
    """
    states, answers = len(STATES), len(PREDICTED_LABELS)
    if len(true) == 0:
        undefined = (float("nan"), float("nan"))
        return F1Intervals((undefined,) * states, undefined)
    _, cluster = np.unique(np.asarray(clusters), return_inverse=True)
    cells = np.zeros((cluster.max() + 1, states * answers), dtype=np.int64)
    np.add.at(cells, (cluster, true * answers + predicted), 1)
    patterns, counts = np.unique(cells, axis=0, return_counts=True)
    draws = generator.multinomial(len(cells), counts / len(cells), size=resamples)
    resampled = scores((draws @ patterns).reshape(resamples, states, answers))  # (R, 3, 4)
    return F1Intervals(
        tuple(_percentile_interval(values) for values in resampled.f1.T),
        _percentile_interval(resampled.macro.f1),
    )


def _percentile_interval(values: Floats) -> Interval:
    defined = values[~np.isnan(values)]  # a resample without a state says nothing about that state's F1
    if len(defined) == 0:
        return float("nan"), float("nan")
    low, high = np.quantile(defined, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)


@dataclass(frozen=True)
class McNemar:
    """Exact McNemar test: how often exactly one of two networks was right, and the two-sided p-value."""

    only_first_right: int
    only_second_right: int
    p_value: float


def mcnemar(first_right: NDArray[np.bool_], second_right: NDArray[np.bool_]) -> McNemar:
    """Test whether two networks err equally often on the same N samples (McNemar 1947, exact binomial form).

    Args:
        first_right: (N,) whether the first network was right.
        second_right: (N,) the same samples for the second.
    """
    only_first = int(np.count_nonzero(first_right & ~second_right))
    only_second = int(np.count_nonzero(second_right & ~first_right))
    discordant = only_first + only_second
    p_value = float(binomtest(only_first, discordant).pvalue) if discordant else 1.0
    return McNemar(only_first, only_second, p_value)


def holm(p_values: Sequence[float]) -> list[float]:
    """Adjust p-values for their number, in their own order (Holm 1979)."""
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for rank, position in enumerate(np.argsort(p_values, kind="stable")):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[position]))
        adjusted[position] = largest
    return adjusted


def mean_and_deviation(values: Sequence[float]) -> Interval:
    """Give mean and sample standard deviation (n - 1); NaN where there are too few values."""
    mean = float(np.mean(values)) if len(values) else float("nan")
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
    return mean, deviation
