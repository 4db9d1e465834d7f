# SPDX-License-Identifier: Apache-2.0
"""All tables of a comparison, in the order of the paper, and the folder they are written to."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from doorstate._files import write_text
from doorstate.evaluation.head_tables import head_tables
from doorstate.evaluation.results import Results
from doorstate.evaluation.rule_tables import abstentions_table, angle_table, open_or_not_table
from doorstate.evaluation.run_tables import error_kinds_table, misclassified_table, runs_table
from doorstate.evaluation.score_tables import (
    calibration_table,
    confusion_table,
    factors_table,
    folds_table,
    kinds_table,
    pairwise_table,
    scores_table,
    summary_table,
)
from doorstate.evaluation.stratum_tables import dataset_tables, decidable_table, state_table
from doorstate.evaluation.table import Table
from doorstate.types import STATES


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
