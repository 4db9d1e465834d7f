# SPDX-License-Identifier: Apache-2.0
"""Scores of each method: pooled over the test folds with intervals, and fold by fold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from doorstate.evaluation.intervals import F1Intervals, Interval, bootstrap_f1, bounds, wilson_interval
from doorstate.evaluation.manifest import text_values
from doorstate.evaluation.metrics import (
    Floats,
    confusion,
    macro_f1,
    mean_and_deviation,
    precision_recall_f1,
    ratio,
)
from doorstate.evaluation.results import Results
from doorstate.types import ABSTAINED, PREDICTED_LABELS, STATES

MACRO = "macro"


def predicted_labels(results: Results) -> tuple[str, ...]:
    """Return the columns of a confusion matrix: the states, and `abstained` if any method abstained."""
    return PREDICTED_LABELS if (results.tested["predicted"] == ABSTAINED).any() else STATES


def confusion_counts(results: Results) -> pd.DataFrame:
    """Return the pooled confusion matrix of each method: columns method, state, one a predicted label, total."""
    rows = [
        {"method": method, "state": state, **dict(zip(PREDICTED_LABELS, counts, strict=True))}
        | {"total": counts.sum()}
        for method in results.methods
        for state, counts in zip(STATES, confusion(results.tested_by(method)), strict=True)
    ]
    return pd.DataFrame(rows, columns=["method", "state", *PREDICTED_LABELS, "total"])


def f1_intervals(results: Results, method: str) -> F1Intervals:
    """Return bootstrap intervals of a method's F1; poses are drawn as a whole where the data set has poses."""
    tested = results.tested_by(method)
    pose = text_values(tested, "pose_id")
    # One seed for all methods: they are compared under the same resamples.
    generator = np.random.default_rng(results.config.seed)
    return bootstrap_f1(tested, pose.where(pose != "", tested["sample_id"]), generator)


def fold_scores(results: Results) -> pd.DataFrame:
    """Return the macro F1 of every finished fold: columns method, fold, f1."""
    rows = [
        {"method": run.method, "fold": run.fold, "f1": macro_f1(tested[tested["fold"] == run.fold])}
        for method in results.methods
        for tested in [results.tested_by(method)]
        for run in results.runs_of(method)
    ]
    return pd.DataFrame(rows, columns=["method", "fold", "f1"])


def summarize_methods(results: Results) -> pd.DataFrame:
    """Summarize each method in a row.

    Returns:
        Columns method, samples, errors, accuracy with `_low` and `_high` (Wilson), and those of `score_states` for the
        mean over the states.
    """
    rows = []
    for method in results.methods:
        correct = results.tested_by(method)["correct"]
        rows.append(
            {
                "method": method,
                "samples": len(correct),
                "errors": int((~correct).sum()),
                "accuracy": float(ratio(correct.sum(), len(correct))),
                **bounds("accuracy", wilson_interval(int(correct.sum()), len(correct))),
            }
        )
    states = score_states(results)
    return pd.DataFrame(rows).merge(states[states["state"] == MACRO].drop(columns="state"), on="method")


def score_states(results: Results) -> pd.DataFrame:
    """Score each state of each method, and their mean in a row with state `macro`.

    Returns:
        Columns method, state, precision, recall and f1 with `_low` and `_high` (Wilson, bootstrap; NaN for the Wilson
        interval of a mean), f1_mean and f1_deviation over folds.
    """
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        counts, intervals = confusion(tested), f1_intervals(results, method)
        by_fold = precision_recall_f1(
            np.stack([confusion(tested[tested["fold"] == run.fold]) for run in results.runs_of(method)])
        )
        score, hits = precision_recall_f1(counts), np.diagonal(counts)
        for index, state in enumerate(STATES):
            predicted_samples, state_samples = counts[:, index].sum(), counts[index].sum()
            rows.append(
                {"method": method, "state": state}
                | _scores_row(score.precision[index], score.recall[index], score.f1[index])
                | bounds("precision", wilson_interval(hits[index], predicted_samples))
                | bounds("recall", wilson_interval(hits[index], state_samples))
                | _f1_row(intervals.per_state[index], by_fold.f1[:, index])
            )
        macro = score.macro
        rows.append(
            {"method": method, "state": MACRO}
            | _scores_row(macro.precision, macro.recall, macro.f1)
            | _f1_row(intervals.macro, by_fold.macro.f1)
        )
    return pd.DataFrame(rows)


def _scores_row(precision: Floats, recall: Floats, f1: Floats) -> dict[str, Any]:
    return {"precision": float(precision), "recall": float(recall), "f1": float(f1)}


def _f1_row(interval: Interval, by_fold: Floats) -> dict[str, Any]:
    mean, deviation = mean_and_deviation(by_fold.tolist())
    return {**bounds("f1", interval), "f1_mean": mean, "f1_deviation": deviation}
