# SPDX-License-Identifier: Apache-2.0
"""Publish finished runs: predictions, metrics and configuration, and the tested rows of their data sets."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from doorstate._files import write_csv
from doorstate.dataset.store import open_dataset
from doorstate.evaluation.predictions import load_results, save_results
from doorstate.evaluation.results import Results
from doorstate.evaluation.study import load_study_results, save_study_results
from doorstate.simulation.manifest import MANIFEST_FILE

from . import paths
from .definition import read_definition


def publish(name: str) -> Path:
    """Write the finished runs of `runs/NAME` into `results/NAME`; return the folder.

    Raises:
        RunError: no run is finished.
    """
    source, target = paths.RUNS / name, paths.RESULTS / name
    if read_definition(name).is_study:
        study = load_study_results(source)
        save_study_results(study, target)
        publish_datasets(study.parts.values())
    else:
        results = load_results(source)
        save_results(results, target)
        publish_datasets([results])
    return target


def publish_datasets(comparisons: Iterable[Results]) -> None:
    """Write the tested rows of data sets into `results/datasets`; rows of simulated clouds are enough to replay them.

    An existing data set is not changed.
    """
    for results in comparisons:
        folder = paths.RESULTS / "datasets" / Path(results.config.dataset).name
        if folder.is_dir():
            continue
        roles = results.splits[: results.config.folds]
        tested = {sample for fold in roles for sample, role in fold.items() if role == "test"}
        dataset = open_dataset(results.dataset_folder)
        rows = [row for row in dataset.rows if row["sample_id"] in tested]
        write_csv(folder / f"{MANIFEST_FILE}.gz", rows)
        dataset.description.model_copy(update={"samples": len(rows), "clouds": "replayed"}).save(folder)
