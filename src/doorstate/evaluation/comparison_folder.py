# SPDX-License-Identifier: Apache-2.0
"""Read a comparison folder as training leaves it: `comparison.json`, `splits.csv`, `runs/<method>/fold<k>/`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from doorstate._documents import read_json
from doorstate._files import read_csv
from doorstate.errors import DatasetError, RunError
from doorstate.evaluation.detections import Detections, read_detections
from doorstate.evaluation.results import PROBABILITY_COLUMNS, TEXT_COLUMNS, RunRecord
from doorstate.training.run_folder import RunFolder, run_of

COMPARISON, SPLITS = "comparison.json", "splits.csv"


@dataclass(frozen=True, eq=False)
class RunContents:
    """Files of one run."""

    record: RunRecord
    predictions: pd.DataFrame
    config: Mapping[str, Any]
    detections: Detections


def read_runs(folder: Path, methods: Iterable[str], folds: int) -> list[RunContents]:
    """Read every run that has predictions, in the order of methods and folds.

    Raises:
        RunError: a file is damaged.
    """
    places = [(method, fold, run_of(folder, method, fold)) for method in methods for fold in range(folds)]
    return [read_run(run, method, fold) for method, fold, run in places if run.predictions.exists()]


def read_run(run: RunFolder, method: str, fold: int) -> RunContents:
    """Read one run that has predictions.

    Raises:
        RunError: a file is damaged.
    """
    parts = [_with_head_outputs(_read_predictions(run.predictions), run.head_outputs).assign(role="test")]
    if run.validation.exists():
        validation = _with_head_outputs(_read_predictions(run.validation), run.validation_heads)
        parts.append(validation.assign(role="val"))
    config = read_json(run.config) if run.config.exists() else {}
    return RunContents(
        RunRecord(
            method,
            fold,
            read_json(run.metrics) if run.metrics.exists() else {},
            read_json(run.environment) if run.environment.exists() else {},
            _numbers(run.log, ("epoch",)) if run.log.exists() else pd.DataFrame(),
        ),
        pd.concat(parts, ignore_index=True).assign(method=method, fold=fold),
        {name: value for name, value in config.items() if name != "fold"},
        read_detections(run.detections),
    )


def _read_predictions(path: Path) -> pd.DataFrame:
    return _numbers(path, ("sample_id", "state", "predicted", *PROBABILITY_COLUMNS))


def _with_head_outputs(predictions: pd.DataFrame, path: Path) -> pd.DataFrame:
    """Append the columns of further heads, and rows of the samples without a door, which only they cover."""
    if not path.exists():
        return predictions
    outputs = _numbers(path, ("sample_id",))
    own = predictions.drop(columns=[name for name in outputs if name != "sample_id"], errors="ignore")
    beyond = outputs[~outputs["sample_id"].isin(own["sample_id"])]
    return pd.concat([own.merge(outputs, on="sample_id", how="left"), beyond], ignore_index=True)


def _numbers(path: Path, required: Sequence[str]) -> pd.DataFrame:
    """Read a CSV; columns that do not hold text are float64, NaN where a field is empty."""
    try:
        rows = read_csv(path)
    except DatasetError as error:
        raise RunError(str(error), hint="write the file again") from error
    frame = pd.DataFrame(rows, dtype="str") if rows else pd.DataFrame(columns=list(required), dtype="str")
    for name in required:
        if name not in frame:
            raise RunError("column is missing", path=path, field=name, hint="write the file again")
    for name in frame.columns:
        frame[name] = frame[name].where(frame[name] != "")
        if name not in TEXT_COLUMNS:
            try:
                frame[name] = frame[name].map(float, na_action="ignore").astype("float64")
            except ValueError as error:
                raise RunError(str(error), path=path, field=name, hint="write the file again") from error
    return frame
