# SPDX-License-Identifier: Apache-2.0
"""The tables of a comparison, in the order of the paper, and the folder they are written to."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from doorstate._files import write_text
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import calibration_table
from doorstate.evaluation.error_kinds import error_kinds_table
from doorstate.evaluation.factors import factors_table, kinds_table
from doorstate.evaluation.head_tables import answers_table, four_answers_table, parts_table, presence_table
from doorstate.evaluation.metrics import confusion_matrix, scores
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.rule_tables import angle_table, open_table, reasons_table
from doorstate.evaluation.score_tables import (
    confusion_table,
    folds_table,
    paired_table,
    scores_table,
    summary_table,
)
from doorstate.evaluation.stratum_tables import decidable_table, samples_table, state_table, undecidable_table
from doorstate.evaluation.table import UNDEFINED, Table, number
from doorstate.types import STATES

_ERROR_COLUMNS = (
    "opening_angle_deg",
    "distance_m",
    "robot_angle_deg",
    "distance_band",
    "region",
    "visible_leaf_px",
    "same_image_as",
)


def build_tables(results: ComparisonResults, dataset: PreparedDataset) -> dict[str, Table]:
    """Build every table of a comparison under the name of its file.

    Args:
        results: a checked comparison.
        dataset: the prepared data set that it was trained on.
    """
    return {
        "summary": summary_table(results, dataset),
        **dataset_tables(dataset),
        "table2_confusion": confusion_table(results),
        "table3_scores": scores_table(results, dataset),
        **{
            f"table{ordinal}_{state}": state_table(results, dataset, state, ordinal)
            for ordinal, state in enumerate(STATES, start=4)
        },
        "folds": folds_table(results),
        **_filled({"paired_tests": paired_table(results)}),
        "calibration": calibration_table(results),
        "undecidable_accuracy": decidable_table(results, dataset),
        "runs": runs_table(results),
        **_filled(
            {
                "angle_errors": angle_table(results, dataset),
                "open_or_not": open_table(results),
                "reasons": reasons_table(results),
                "factors": factors_table(results, dataset),
                "kinds": kinds_table(results, dataset),
                "head_answers": answers_table(results, dataset),
                "four_answers": four_answers_table(results, dataset),
                "presence": presence_table(results, dataset),
                "parts": parts_table(results),
            }
        ),
        "error_kinds": error_kinds_table(results, dataset),
        "misclassified": misclassified_table(results, dataset),
    }


def _filled(tables: Mapping[str, Table]) -> dict[str, Table]:
    """Leave out tables of nothing: of what only rules or only the simulator know, of pairs of one network."""
    return {name: table for name, table in tables.items() if table.rows}


def dataset_tables(dataset: PreparedDataset) -> dict[str, Table]:
    """Build the tables that need no results."""
    return {"table1_samples": samples_table(dataset), "undecidable_frames": undecidable_table(dataset)}


def write_tables(results: ComparisonResults, dataset: PreparedDataset, folder: Path) -> dict[str, Table]:
    """Write every table as Markdown, LaTeX and CSV; the same inputs give the same bytes.

    Args:
        results: a checked comparison.
        dataset: the prepared data set that it was trained on.
        folder: where the files go; made if absent.

    Returns:
        The tables by the name of their files.
    """
    tables = build_tables(results, dataset)
    save_tables(tables, folder)
    return tables


def save_tables(tables: Mapping[str, Table], folder: Path) -> None:
    """Write `<name>.md`, `<name>.tex` and `<name>.csv` of every table."""
    for name, table in tables.items():
        write_text(folder / f"{name}.md", table.to_markdown())
        write_text(folder / f"{name}.tex", table.to_latex())
        write_text(folder / f"{name}.csv", table.to_csv())


def runs_table(results: ComparisonResults) -> Table:
    """Every run that was asked for: what it trained on, how long, and the epoch it chose."""
    found = {(run.network, run.fold): run for run in results.runs}
    rows = []
    for network in results.comparison.methods:
        for fold in range(results.comparison.folds):
            run = found.get((network, fold))
            if run is None:
                rows.append((network, "missing", str(fold), *[UNDEFINED] * 6))
                continue
            confusion = confusion_matrix(run.predictions.true, run.predictions.predicted)
            rows.append(
                (
                    network,
                    "done",
                    str(fold),
                    number(run.metric("train_samples"), 0),
                    str(len(run.predictions)),
                    number(run.metric("best_epoch"), 0),
                    number(run.metric("val_macro_f1")),
                    number(float(scores(confusion).macro.f1)),
                    number(run.metric("seconds"), 0),
                )
            )
    return Table(
        "Runs",
        (
            "network",
            "status",
            "fold",
            "train samples",
            "test samples",
            "best epoch",
            "validation macro F1",
            "test macro F1",
            "seconds",
        ),
        tuple(rows),
        text_columns=2,
    )


def misclassified_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Every misclassified sample with its probabilities and whatever the manifest says of it."""
    columns = ("network", "fold", "sample_id", "state", "predicted", *(f"p_{state}" for state in STATES))
    rows = []
    for error in results.error_rows:
        row = dataset.rows[dataset.index_of(error.sample_id)]
        rows.append(
            (
                error.network,
                str(error.fold),
                error.sample_id,
                error.state,
                error.predicted,
                *(number(p) for p in error.probabilities),
                *(row.get(name, "") for name in _ERROR_COLUMNS),
            )
        )
    return Table("Misclassified samples", (*columns, *_ERROR_COLUMNS), tuple(rows), text_columns=5)
