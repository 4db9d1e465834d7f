# SPDX-License-Identifier: Apache-2.0
"""Confusion matrices of predictions, and the ratios that follow from them.

A ratio whose denominator is zero is undefined, hence NaN, never a silent zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from doorstate.types import PREDICTED_LABELS, STATES, Indices

Floats = NDArray[np.float64]


def confusion(predictions: pd.DataFrame) -> Indices:
    """Count samples by true state and predicted label.

    Args:
        predictions: columns `state` and `predicted`; rows of samples without a state are left out.

    Returns:
        (3, 4) counts in the order of `STATES` and `PREDICTED_LABELS`.
    """
    cells = confusion_cells(predictions)
    shape = len(STATES), len(PREDICTED_LABELS)
    return np.bincount(cells[cells >= 0], minlength=shape[0] * shape[1]).astype(np.int64).reshape(shape)


def confusion_cells(predictions: pd.DataFrame) -> Indices:
    """Return for each row its cell of a flattened (3, 4) confusion matrix, -1 for a sample without a state."""
    state = label_codes(predictions["state"], STATES)
    predicted = label_codes(predictions["predicted"], PREDICTED_LABELS)
    return np.where((state >= 0) & (predicted >= 0), state * len(PREDICTED_LABELS) + predicted, -1)


def label_codes(values: pd.Series[str], labels: Sequence[str]) -> Indices:
    """Return the (N,) positions of values among labels, -1 for a value that is none of them."""
    return pd.Index(labels).get_indexer(pd.Index(values)).astype(np.int64)


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


def precision_recall_f1(counts: NDArray[Any]) -> Scores:
    """Compute precision, recall and F1 of each state; an abstention is a miss, and no false alarm.

    recall = TP / (TP + FN), precision = TP / (TP + FP), F1 = 2 TP / (2 TP + FP + FN): the standard
    definitions. The formulas printed in Kaleci & Turgut 2021 have the first two denominators swapped; the
    words around them describe the standard ones.

    Args:
        counts: (..., 3, 4) confusion matrices, rows true, columns predicted.
    """
    hits = np.diagonal(counts, axis1=-2, axis2=-1)  # (..., 3)
    true_count = counts.sum(axis=-1)
    predicted_count = counts[..., : len(STATES)].sum(axis=-2)
    return Scores(
        precision=ratio(hits, predicted_count),
        recall=ratio(hits, true_count),
        f1=ratio(2 * hits, true_count + predicted_count),
    )


def macro_f1(predictions: pd.DataFrame) -> float:
    """Return the macro F1 of predictions."""
    return float(precision_recall_f1(confusion(predictions)).macro.f1)


def accuracy(counts: NDArray[Any]) -> float:
    """Return the share of samples on the diagonal of a (3, 4) confusion matrix."""
    return float(ratio(np.trace(counts), counts.sum()))


def mean_and_deviation(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and sample standard deviation (n - 1); NaN where there are too few values."""
    mean = float(np.mean(values)) if len(values) else float("nan")
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
    return mean, deviation
