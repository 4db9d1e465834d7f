# SPDX-License-Identifier: Apache-2.0
"""Load and save studies: several comparisons below one folder, published as one table of predictions.

A published study has the four files of a published comparison. `experiment.json` holds the configuration of every part
and the study's latencies, `splits.csv.gz` the roles by data set, and a column `part` tells comparisons apart.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from doorstate._documents import read_json
from doorstate._files import read_csv, write_csv, write_text
from doorstate.errors import RunError
from doorstate.evaluation.comparison_folder import COMPARISON
from doorstate.evaluation.predictions import load_part, load_results
from doorstate.evaluation.published import (
    EXPERIMENT,
    METRICS,
    PREDICTIONS,
    SPLITS,
    decode_runs,
    encode_runs,
    read_predictions,
    write_predictions,
)
from doorstate.evaluation.results import Results

LATENCY = "latency.csv"


@dataclass(frozen=True, eq=False)
class StudyResults:
    """Comparisons of a study by their folder below it, such as `mixture/cluttered`."""

    parts: Mapping[str, Results]
    latencies_ms: Mapping[tuple[str, int], float] = field(default_factory=dict)
    """Median time from a raw cloud to a state, by network and number of points."""


def load_study_results(folder: Path) -> StudyResults:
    """Load the finished comparisons of a study, from its run folders or its published form.

    Raises:
        RunError: no comparison has predictions, or one cannot be used.
    """
    if (folder / EXPERIMENT).is_file():
        return _load_published(folder)
    folders = sorted(path.parent for path in folder.rglob(COMPARISON))
    finished = [path for path in folders if any(path.glob("runs/*/*/predictions.csv"))]
    if not finished:
        raise RunError("no finished comparison of a study", path=folder)
    rows = read_csv(folder / LATENCY) if (folder / LATENCY).is_file() else []
    return StudyResults(
        {path.relative_to(folder).as_posix(): load_results(path) for path in finished},
        {(row["network"], int(row["points"])): float(row["median_ms"]) for row in rows},
    )


def save_study_results(study: StudyResults, folder: Path) -> None:
    """Write a study in its published form.

    Args:
        study: results in which all comparisons of one data set have the same splits.
        folder: folder to write, made if absent.

    Raises:
        RunError: two comparisons of one data set have different splits.
    """
    document = {
        "parts": {name: results.config.model_dump(mode="json") for name, results in study.parts.items()},
        "latencies_ms": [[network, points, ms] for (network, points), ms in study.latencies_ms.items()],
    }
    write_text(folder / EXPERIMENT, json.dumps(document, indent=1) + "\n")
    runs = [f"{json.dumps(name)}: {encode_runs(results.runs)}" for name, results in study.parts.items()]
    write_text(folder / METRICS, '{"parts": {\n' + ",\n".join(runs) + "\n}}\n")
    _write_splits(study, folder / SPLITS)
    tables = [results.predictions.assign(part=name) for name, results in study.parts.items()]
    table = pd.concat(tables, ignore_index=True)
    write_predictions(table[["part", *table.columns.drop("part")]], folder / PREDICTIONS)


def _write_splits(study: StudyResults, path: Path) -> None:
    by_dataset: dict[str, Results] = {}
    for results in study.parts.values():
        same = by_dataset.setdefault(results.config.dataset, results)
        if same.splits != results.splits:
            raise RunError(
                f"{results.config.name} has other splits than {same.config.name}", path=path, field="dataset"
            )
    rows: list[dict[str, str]] = []
    for dataset, results in by_dataset.items():
        for sample in results.splits[0]:
            roles = {f"fold_{fold}": split[sample] for fold, split in enumerate(results.splits)}
            rows.append({"dataset": dataset, "sample_id": sample, **roles})
    write_csv(path, rows)


def _load_published(folder: Path) -> StudyResults:
    document, metrics = read_json(folder / EXPERIMENT), read_json(folder / METRICS)
    path = folder / PREDICTIONS
    tables = dict(iter(read_predictions(path).groupby("part", sort=False)))
    splits = _read_splits(folder / SPLITS)
    parts: dict[str, Results] = {}
    try:
        for name, config in document["parts"].items():
            table = tables[name].dropna(axis=1, how="all").drop(columns="part")
            runs = decode_runs(metrics["parts"][name])
            parts[name] = load_part(folder, config, splits[config["dataset"]], table, runs)
        latencies_ms = {(network, int(points)): float(ms) for network, points, ms in document["latencies_ms"]}
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"is no published study ({error!r})", path=folder) from error
    return StudyResults(parts, latencies_ms)


def _read_splits(path: Path) -> dict[str, tuple[dict[str, Any], ...]]:
    table = pd.DataFrame(read_csv(path), dtype="str")
    folds = table.columns.drop(["dataset", "sample_id"])
    return {
        str(dataset): tuple(
            dict(zip(rows["sample_id"], rows[fold], strict=True))
            for fold in folds
            if (rows[fold] != "").all()
        )
        for dataset, rows in table.groupby("dataset", sort=False)
    }
