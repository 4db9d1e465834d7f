# SPDX-License-Identifier: Apache-2.0
"""Tables of scores: summary, confusion, states, folds, pairs of methods, calibration, factors and kinds."""

from __future__ import annotations

import pandas as pd

from doorstate.evaluation.calibration import BINS, score_calibration
from doorstate.evaluation.factors import score_factors, score_kinds
from doorstate.evaluation.method_scores import (
    confusion_counts,
    fold_scores,
    predicted_labels,
    score_states,
    summarize_methods,
)
from doorstate.evaluation.metrics import mean_and_deviation
from doorstate.evaluation.pairwise import pairwise_tests
from doorstate.evaluation.results import Results
from doorstate.evaluation.table import (
    UNDEFINED,
    Table,
    count_column,
    deviation_column,
    interval_column,
    label_column,
    number_column,
    p_value_column,
    plain_column,
)
from doorstate.types import ABSTAINED

_METHOD = label_column("method")


def summary_table(results: Results) -> Table:
    """Build the summary: one row a method, macro scores with intervals and their spread over folds."""
    return Table.from_frame(
        "Summary",
        summarize_methods(results),
        (
            _METHOD,
            count_column("samples"),
            count_column("errors"),
            number_column("accuracy"),
            interval_column("accuracy", "accuracy 95% CI"),
            number_column("precision"),
            number_column("recall"),
            number_column("f1", "macro F1"),
            interval_column("f1", "macro F1 95% CI"),
            deviation_column("f1", "macro F1 over folds"),
        ),
        "Pooled over the test folds. Accuracy: Wilson interval. F1: percentile bootstrap over poses, which "
        "shrinks to a point where a method makes no error; the Wilson interval does not. Over folds: mean "
        "and sample standard deviation.",
    )


def confusion_table(results: Results) -> Table:
    """Build Table 2: pooled confusion matrices, with a column of abstentions where a method abstained."""
    labels = predicted_labels(results)
    return Table.from_frame(
        "Table 2. Confusion matrices, summed over the test folds",
        confusion_counts(results),
        (
            _METHOD,
            label_column("state", "true state"),
            *(count_column(name, name if name == ABSTAINED else f"as {name}") for name in labels),
            count_column("total"),
        ),
    )


def scores_table(results: Results) -> Table:
    """Build Table 3: precision, recall and F1 by method and state, with intervals and the spread over folds."""
    return Table.from_frame(
        "Table 3. Precision, recall and F1",
        score_states(results),
        (
            _METHOD,
            label_column("state"),
            number_column("precision"),
            interval_column("precision", "precision 95% CI"),
            number_column("recall"),
            interval_column("recall", "recall 95% CI"),
            number_column("f1", "F1"),
            interval_column("f1", "F1 95% CI"),
            deviation_column("f1", "F1 over folds"),
        ),
        "Pooled over the test folds. Precision and recall: Wilson intervals. F1: percentile bootstrap over "
        "poses. Recall = TP / (TP + FN), precision = TP / (TP + FP). "
        f"{UNDEFINED}: undefined, or no interval is given.",
    )


def folds_table(results: Results) -> Table:
    """Build the table of macro F1 by fold, with mean and sample standard deviation."""
    names = [f"fold{fold}" for fold in range(results.config.folds)]
    rows = []
    for method, scores in fold_scores(results).groupby("method", sort=False):
        mean, deviation = mean_and_deviation(scores["f1"].tolist())
        by_fold = {f"fold{fold}": f1 for fold, f1 in zip(scores["fold"], scores["f1"], strict=True)}
        rows.append({"method": method, **by_fold, "mean": mean, "deviation": deviation})
    frame = pd.DataFrame(rows, columns=["method", *names, "mean", "deviation"]).astype(
        dict.fromkeys(names, "float64")
    )
    return Table.from_frame(
        "Macro F1 by test fold",
        frame,
        (
            _METHOD,
            *(number_column(name, name.replace("fold", "fold ")) for name in names),
            number_column("mean"),
            number_column("deviation", "SD"),
        ),
        "SD: sample standard deviation over the finished folds.",
    )


def pairwise_table(results: Results) -> Table:
    """Build the table of paired tests between methods."""
    return Table.from_frame(
        "Paired tests between methods",
        pairwise_tests(results),
        (
            label_column("first"),
            label_column("second"),
            count_column("samples"),
            count_column("only_first_correct", "only first correct"),
            count_column("only_second_correct", "only second correct"),
            p_value_column("p", "p"),
            p_value_column("p_holm", "p (Holm)"),
        ),
        "Exact McNemar test on the shared test samples, Holm correction over the pairs. It takes samples as "
        "independent; the states of one pose and neighbouring poses are not, so a small p is optimistic.",
    )


def calibration_table(results: Results) -> Table:
    """Build the table of temperatures and calibration scores."""
    titles = {"ece": "ECE", "cross_entropy": "cross entropy", "brier": "Brier score"}
    return Table.from_frame(
        "Calibration",
        score_calibration(results),
        (
            _METHOD,
            deviation_column("temperature", "temperature over folds", 3),
            *(
                number_column(f"{name}_{kind}", f"{title}, {kind}")
                for name, title in titles.items()
                for kind in ("raw", "scaled")
            ),
        ),
        f"Pooled test predictions; the temperature of each fold was fitted on its validation samples. ECE: {BINS} "
        "equal bins of the probability of the predicted state. Networks are trained with label smoothing and are "
        "under-confident: temperatures below 1 sharpen.",
    )


def factors_table(results: Results) -> Table:
    """Build the table of accuracy by factor and bin."""
    return Table.from_frame(
        "Accuracy against one factor at a time",
        score_factors(results),
        (
            _METHOD,
            label_column("factor"),
            plain_column("low", "from"),
            plain_column("high", "to"),
            count_column("samples"),
            count_column("correct"),
            number_column("accuracy"),
        ),
    )


def kinds_table(results: Results) -> Table:
    """Build the table of accuracy by kind of sample."""
    return Table.from_frame(
        "Accuracy by kind of sample",
        score_kinds(results),
        (
            _METHOD,
            label_column("kind"),
            label_column("value"),
            count_column("samples"),
            count_column("correct"),
            number_column("accuracy"),
        ),
    )
