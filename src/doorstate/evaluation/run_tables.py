# SPDX-License-Identifier: Apache-2.0
"""Tables of runs and of their errors."""

from __future__ import annotations

import math

import pandas as pd

from doorstate._paths import csv_name
from doorstate.evaluation.errors import RANGES, list_errors, summarize_errors
from doorstate.evaluation.method_scores import fold_scores
from doorstate.evaluation.results import PROBABILITY_COLUMNS, Results
from doorstate.evaluation.table import (
    UNDEFINED,
    Column,
    Table,
    count_column,
    label_column,
    number,
    number_column,
    text_column,
)

_METHOD = label_column("method")


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
    errors = list_errors(results)
    names = [name for name in ("sample_id", "same_image_as") if name in errors]
    return Table.from_frame(
        "Misclassified samples",
        errors.assign(**{name: errors[name].map(csv_name, na_action="ignore") for name in names}),
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
        return UNDEFINED if math.isnan(values[0]) else " / ".join(number(value, digits) for value in values)

    return Column(title, tuple(f"{name}_{end}" for end in ("min", "median", "max")), text)
