# SPDX-License-Identifier: Apache-2.0
"""Scores of each method: pooled over the test folds with intervals, and fold by fold."""

from __future__ import annotations

import numpy as np
import pandas as pd

from doorstate.evaluation.comparison import Results
from doorstate.evaluation.intervals import F1Intervals, bootstrap_f1, bounds, wilson_interval
from doorstate.evaluation.manifest import text_column
from doorstate.evaluation.metrics import accuracy, confusion, macro_f1, mean_and_deviation, scores
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
    pose = text_column(tested, "pose_id")
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
        Columns method, samples, errors, accuracy, precision, recall, f1 (macro), with `_low` and `_high` of accuracy
        (Wilson) and F1 (bootstrap), and f1_mean and f1_deviation over folds.
    """
    folds = fold_scores(results)
    rows = []
    for method in results.methods:
        counts = confusion(results.tested_by(method))
        total, correct = int(counts.sum()), int(np.trace(counts))
        macro, interval = scores(counts).macro, f1_intervals(results, method).macro
        mean, deviation = mean_and_deviation(folds.loc[folds["method"] == method, "f1"].tolist())
        rows.append(
            {
                "method": method,
                "samples": total,
                "errors": total - correct,
                "accuracy": accuracy(counts),
                **bounds("accuracy", wilson_interval(correct, total)),
                "precision": float(macro.precision),
                "recall": float(macro.recall),
                "f1": float(macro.f1),
                **bounds("f1", interval),
                "f1_mean": mean,
                "f1_deviation": deviation,
            }
        )
    return pd.DataFrame(rows)


def score_states(results: Results) -> pd.DataFrame:
    """Score each state of each method, and their mean in a row with state `macro`.

    Returns:
        Columns method, state, precision, recall and f1 with `_low` and `_high` (Wilson, bootstrap; NaN for the Wilson
        interval of a mean), f1_mean and f1_deviation over folds.
    """
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        counts = confusion(tested)
        score, intervals = scores(counts), f1_intervals(results, method)
        folds = scores(
            np.stack([confusion(tested[tested["fold"] == run.fold]) for run in results.runs_of(method)])
        )
        for index, state in enumerate(STATES):
            hits = int(counts[index, index])
            mean, deviation = mean_and_deviation(folds.f1[:, index].tolist())
            rows.append(
                {
                    "method": method,
                    "state": state,
                    "precision": score.precision[index],
                    **bounds("precision", wilson_interval(hits, int(counts[:, index].sum()))),
                    "recall": score.recall[index],
                    **bounds("recall", wilson_interval(hits, int(counts[index].sum()))),
                    "f1": score.f1[index],
                    **bounds("f1", intervals.per_state[index]),
                    "f1_mean": mean,
                    "f1_deviation": deviation,
                }
            )
        mean, deviation = mean_and_deviation(folds.macro.f1.tolist())
        rows.append(
            {
                "method": method,
                "state": MACRO,
                "precision": float(score.macro.precision),
                "recall": float(score.macro.recall),
                "f1": float(score.macro.f1),
                **bounds("f1", intervals.macro),
                "f1_mean": mean,
                "f1_deviation": deviation,
            }
        )
    return pd.DataFrame(rows)
