# SPDX-License-Identifier: Apache-2.0
"""Checks that predictions fit their splits and the manifest of their data set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from doorstate.dataset.roles import Role
from doorstate.errors import RunError
from doorstate.evaluation.results import PROBABILITY_COLUMNS, Results
from doorstate.types import LABELS, PREDICTED_LABELS, STATES

_AGAIN = "test this run again"


def check_predictions(results: Results, path_of: Callable[[str, int], Path]) -> None:
    """Check every run of results.

    Args:
        results: results to check, in any order of rows.
        path_of: file with the predictions of a method and fold, for errors.

    Raises:
        RunError: a label is unknown, a probability of a network is not finite, a sample is tested twice or has another
            role, a state differs from the manifest, or test samples are missing.
    """
    table = results.predictions
    groups: dict[tuple[str, int], Any] = {}
    for (method, fold), rows in table.groupby(["method", "fold"], sort=False):
        groups[str(method), int(str(fold))] = rows.index
    for record in results.runs:
        path = path_of(record.method, record.fold)
        if not 0 <= record.fold < len(results.splits):
            raise RunError(f"no fold {record.fold} in the splits", path=path, field="fold")
        run = table.loc[groups.pop((record.method, record.fold), [])]
        _check_labels(run, path, is_rule=record.method in results.rules)
        _check_roles(run, results.splits[record.fold], record.fold, path)
        _check_states(run, results.manifest["state"], path)
        _check_count(run, results, record.fold, path)
    for method, fold in groups:
        raise RunError(f"no metrics of {method}, fold {fold}", path=path_of(method, fold), field="method")
    tested = table[table["role"] == "test"]
    repeated = tested[tested.duplicated(["method", "sample_id"])]
    if len(repeated):
        row = repeated.iloc[0]
        same = (tested["method"] == row["method"]) & (tested["sample_id"] == row["sample_id"])
        raise RunError(
            f"sample {row['sample_id']} was already tested in fold {tested.loc[same, 'fold'].iloc[0]}",
            path=path_of(row["method"], int(row["fold"])),
            field="sample_id",
        )


def _check_labels(run: pd.DataFrame, path: Path, *, is_rule: bool) -> None:
    has_state = run["state"].isin(STATES)
    for column, labels, checked in (
        ("state", LABELS, ~has_state),
        ("predicted", PREDICTED_LABELS, has_state),
    ):
        unknown = run.loc[checked & ~run[column].isin(labels), column]
        if len(unknown):
            raise RunError(
                f"unknown label {unknown.iloc[0]!r}",
                path=path,
                field=column,
                expected=f"one of {', '.join(labels)}",
                hint=_AGAIN,
            )
    if not is_rule and not np.isfinite(run.loc[has_state, list(PROBABILITY_COLUMNS)].to_numpy()).all():
        raise RunError("a probability is not finite", path=path, hint=_AGAIN)


def _check_roles(run: pd.DataFrame, roles: Mapping[str, Role], fold: int, path: Path) -> None:
    wrong = run[run["sample_id"].map(pd.Series(roles, dtype="str")) != run["role"]]
    if len(wrong):
        row = wrong.iloc[0]
        raise RunError(
            f"sample {row['sample_id']} is not a {row['role']} sample of fold {fold} in the splits",
            path=path,
            field="sample_id",
        )


def _check_states(run: pd.DataFrame, states: pd.Series[str], path: Path) -> None:
    # A published manifest holds the tested samples only.
    expected = run["sample_id"].map(states)
    wrong = run[(expected != run["state"]) & ((run["role"] == "test") | expected.notna())]
    if len(wrong):
        row = wrong.iloc[0]
        raise RunError(
            f"sample {row['sample_id']} is {row['state']} here and {states.get(row['sample_id'], 'absent')} in the "
            "manifest of the data set",
            path=path,
            field="state",
            hint="use the data set of this comparison",
        )


def _check_count(run: pd.DataFrame, results: Results, fold: int, path: Path) -> None:
    roles = pd.Series(results.splits[fold], dtype="str")
    states = roles.index.to_series().map(results.manifest["state"])
    expected = int(((roles == "test") & states.isin(STATES)).sum())
    count = int(((run["role"] == "test") & run["state"].isin(STATES)).sum())
    if count != expected:
        raise RunError(f"{count} of {expected} test samples of fold {fold}", path=path, hint=_AGAIN)
