# SPDX-License-Identifier: Apache-2.0
"""Tables of a comparison, in the order of the paper: titles, columns and notes over the numbers of the metrics."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from doorstate._files import write_text
from doorstate.evaluation.calibration import BINS, score_calibration
from doorstate.evaluation.comparison import PROBABILITY_COLUMNS, Results
from doorstate.evaluation.errors import RANGES, list_errors, summarize_errors
from doorstate.evaluation.factors import score_factors, score_kinds
from doorstate.evaluation.head_tables import head_tables
from doorstate.evaluation.method_scores import (
    confusion_counts,
    fold_scores,
    predicted_labels,
    score_states,
    summarize_methods,
)
from doorstate.evaluation.metrics import mean_and_deviation
from doorstate.evaluation.pairwise import pairwise_tests
from doorstate.evaluation.rule_outputs import count_abstentions, score_angles, score_open_or_not
from doorstate.evaluation.stratum_tables import dataset_tables, decidable_table, state_table
from doorstate.evaluation.table import (
    UNDEFINED,
    Column,
    Table,
    count_column,
    deviation_column,
    interval_column,
    label_column,
    number,
    number_column,
    p_value_column,
    plain_column,
    text_column,
)
from doorstate.types import ABSTAINED, STATES

_METHOD = label_column("method")


def build_tables(results: Results) -> dict[str, Table]:
    """Build every table of a comparison under the name of its file.

    Tables that are about rules, heads or pairs of methods are left out where there are none.
    """
    tables = {
        "summary": summary_table(results),
        **dataset_tables(results.manifest),
        "table2_confusion": confusion_table(results),
        "table3_scores": scores_table(results),
        **{
            f"table{ordinal}_{state}": state_table(results, state, ordinal)
            for ordinal, state in enumerate(STATES, start=4)
        },
        "folds": folds_table(results),
        "calibration": calibration_table(results),
        "undecidable_accuracy": decidable_table(results),
        "runs": runs_table(results),
        "error_kinds": error_kinds_table(results),
        "misclassified": misclassified_table(results),
    }
    optional = {
        "pairwise_tests": pairwise_table(results),
        "angle_errors": angle_table(results),
        "open_or_not": open_or_not_table(results),
        "abstentions": abstentions_table(results),
        "factors": factors_table(results),
        "kinds": kinds_table(results),
        **head_tables(results),
    }
    return {**tables, **{name: table for name, table in optional.items() if table.rows}}


def save_tables(tables: Mapping[str, Table], folder: Path) -> None:
    """Write `<name>.csv` of every table; the same tables give the same bytes."""
    for name, table in tables.items():
        write_text(folder / f"{name}.csv", table.to_csv())


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


def runs_table(results: Results) -> Table:
    """Build the table of planned runs: training samples, time, and the selected epoch."""
    records = {(run.method, run.fold): run for run in results.runs}
    test_f1 = fold_scores(results).set_index(["method", "fold"])["f1"]
    test_samples = results.tested.groupby(["method", "fold"]).size()
    rows = []
    for method in results.config.methods:
        for fold in range(results.config.folds):
            run = records.get((method, fold))
            row: dict[str, object] = {
                "method": method,
                "status": "missing" if run is None else "done",
                "fold": fold,
            }
            if run is not None:
                row |= {
                    "train_samples": run.metric("train_samples"),
                    "test_samples": test_samples[method, fold],
                    "best_epoch": run.metric("best_epoch"),
                    "val_macro_f1": run.metric("val_macro_f1"),
                    "test_macro_f1": test_f1[method, fold],
                    "seconds": run.metric("seconds"),
                }
            rows.append(row)
    frame = pd.DataFrame(
        rows,
        columns=[
            *("method", "status", "fold", "train_samples", "test_samples", "best_epoch"),
            *("val_macro_f1", "test_macro_f1", "seconds"),
        ],
    )
    return Table.from_frame(
        "Runs",
        frame,
        (
            _METHOD,
            label_column("status"),
            count_column("fold"),
            count_column("train_samples", "training samples"),
            count_column("test_samples", "test samples"),
            count_column("best_epoch", "best epoch"),
            number_column("val_macro_f1", "validation macro F1"),
            number_column("test_macro_f1", "test macro F1"),
            count_column("seconds"),
        ),
    )


def misclassified_table(results: Results) -> Table:
    """Build the table of every misclassified sample."""
    return Table.from_frame(
        "Misclassified samples",
        list_errors(results),
        (
            _METHOD,
            Column("fold", ("fold",), str, is_label=True),
            *(label_column(name) for name in ("sample_id", "state", "predicted")),
            *(number_column(name) for name in PROBABILITY_COLUMNS),
            number_column("opening_angle_deg", "opening angle, °", 1),
            number_column("distance_m", "distance, m", 2),
            number_column("robot_angle_deg", "angle to the door frame, °", 1),
            text_column("distance_band", "band, m"),
            text_column("region"),
            count_column("visible_leaf_px", "leaf pixels"),
            text_column("same_image_as", "same image as"),
        ),
    )


def error_kinds_table(results: Results) -> Table:
    """Build the table of errors by method, true state and predicted label."""
    titles = {"opening_angle_deg": ("opening angle, °", 0), "distance_m": ("distance, m", 1)}
    titles["visible_leaf_px"] = ("leaf pixels", 0)

    return Table.from_frame(
        "Errors by kind",
        summarize_errors(results),
        (
            _METHOD,
            label_column("state", "true state"),
            label_column("predicted", "predicted as"),
            count_column("errors"),
            text_column("regions"),
            *(_range_column(name, *titles[name]) for name in RANGES),
        ),
        "Ranges: least, median and greatest value. Regions: how many of the errors lie in which angle region. "
        f"{UNDEFINED}: not recorded.",
    )


def _range_column(name: str, title: str, digits: int) -> Column:
    def text(*values: float) -> str:
        return UNDEFINED if np.isnan(values[0]) else " / ".join(number(value, digits) for value in values)

    return Column(title, tuple(f"{name}_{end}" for end in ("min", "median", "max")), text)


def angle_table(results: Results) -> Table:
    """Build the table of errors of the opening angle, by region."""
    return Table.from_frame(
        "Error of the opening angle, in degrees",
        score_angles(results),
        (
            _METHOD,
            label_column("region"),
            count_column("doors"),
            count_column("measured", "angle measured"),
            number_column("mean_deg", "mean", 1),
            number_column("median_deg", "median", 1),
            number_column("p95_deg", "95th percentile", 1),
        ),
        "Semi-open and open doors. The simulator knows the angle; a sample without a measured angle is not counted.",
    )


def open_or_not_table(results: Results) -> Table:
    """Build the table of open against not open."""
    return Table.from_frame(
        "Open or not",
        score_open_or_not(results),
        (
            _METHOD,
            number_column("recall", "recall of open"),
            number_column("precision", "precision of open"),
            number_column("accuracy"),
            count_column("abstained"),
        ),
        "Closed and semi-open are both not open. An abstention counts as wrong.",
    )


def abstentions_table(results: Results) -> Table:
    """Build the table of reasons to abstain."""
    columns = (_METHOD, label_column("reason"), count_column("samples"))
    return Table.from_frame("Reasons to abstain", count_abstentions(results), columns)


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
