# SPDX-License-Identifier: Apache-2.0
"""Published form of a comparison: four files, of which predictions and splits are compressed tables.

`experiment.json` holds the resolved configuration and the settings of every method, `metrics.json` the metrics,
environment and epoch log of every run. The same results give the same bytes.
"""

from __future__ import annotations

import io
import json
import warnings
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from doorstate._documents import read_json
from doorstate._files import read_table_text, write_compressed_text, write_text
from doorstate.dataset.splits import write_splits
from doorstate.errors import DatasetError, RunError
from doorstate.evaluation.results import KEY_COLUMNS, TEXT_COLUMNS, Results, RunRecord

EXPERIMENT, METRICS = "experiment.json", "metrics.json"
SPLITS, PREDICTIONS = "splits.csv.gz", "predictions.csv.gz"


def save_results(results: Results, folder: Path) -> None:
    """Write results in their published form.

    Args:
        results: results of one comparison.
        folder: folder to write, made if absent.
    """
    document = results.config.model_dump(mode="json")
    write_text(folder / EXPERIMENT, json.dumps(document, indent=1) + "\n")
    write_text(folder / METRICS, f'{{"runs": {encode_runs(results.runs)}}}\n')
    write_splits(folder / SPLITS, [dict(roles) for roles in results.splits])
    write_predictions(results.predictions, folder / PREDICTIONS)


def write_predictions(predictions: pd.DataFrame, path: Path) -> None:
    """Write a table of predictions, compressed; the same table gives the same bytes."""
    # 15 digits are more than any of these numbers has, and read back as the same float64.
    write_compressed_text(path, predictions.to_csv(index=False, lineterminator="\n", float_format="%.15g"))


def read_predictions(path: Path) -> pd.DataFrame:
    """Read a published table of predictions.

    Raises:
        RunError: the file is missing or damaged.
    """
    try:
        with warnings.catch_warnings():
            # pandas only warns where it cuts off a line that is longer than the header.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            warnings.simplefilter("error", RuntimeWarning)  # NumPy's, for what is no whole number
            frame = pd.read_csv(
                io.StringIO(read_table_text(path)),
                dtype={**dict.fromkeys(TEXT_COLUMNS, "str"), "fold": "int64"},
                keep_default_na=False,
                na_values=[""],
                index_col=False,
            )
        numeric = [name for name in frame if name not in (*TEXT_COLUMNS, "fold")]
        frame = frame.astype(dict.fromkeys(numeric, "float64"))
    except (
        DatasetError,
        OSError,
        EOFError,
        zlib.error,
        ValueError,
        OverflowError,
        pd.errors.ParserWarning,
        RuntimeWarning,
    ) as error:
        reason = error.message if isinstance(error, DatasetError) else error
        raise RunError(f"cannot be read ({reason})", path=path) from error
    for name in KEY_COLUMNS:
        if name not in frame:
            raise RunError("column is missing", path=path, field=name)
    return frame


def read_records(path: Path) -> list[RunRecord]:
    """Read the metrics, environment and epoch log of every run.

    Raises:
        RunError: the file is missing or damaged.
    """
    try:
        return decode_runs(read_json(path)["runs"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise RunError(f"holds no list of runs ({error!r})", path=path) from error


def encode_runs(runs: Iterable[RunRecord]) -> str:
    """Return records of runs as JSON, one run a line."""
    return "[\n" + ",\n".join(json.dumps(_encode_run(run)) for run in runs) + "\n]"


def decode_runs(runs: Iterable[Mapping[str, Any]]) -> list[RunRecord]:
    """Return records of runs from what `encode_runs` wrote.

    Raises:
        KeyError, TypeError, ValueError, OverflowError: `runs` is something else.
    """
    return [
        RunRecord(
            run["method"],
            int(run["fold"]),
            run["metrics"],
            run["environment"],
            pd.DataFrame(run["log"], dtype="float64"),
        )
        for run in runs
    ]


def _encode_run(run: RunRecord) -> dict[str, Any]:
    log = {name: [None if value != value else value for value in run.log[name].tolist()] for name in run.log}
    return {
        "method": run.method,
        "fold": run.fold,
        "metrics": run.metrics,
        "environment": run.environment,
        "log": log,
    }
