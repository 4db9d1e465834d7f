# SPDX-License-Identifier: Apache-2.0
"""Load the results of a comparison from its folder or from its published form, and check them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import ValidationError

from doorstate._documents import read_json
from doorstate.dataset.roles import Role
from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import manifest_path
from doorstate.errors import DatasetError, RunError, first_validation_error
from doorstate.evaluation import comparison_folder, published
from doorstate.evaluation.checks import check_predictions
from doorstate.evaluation.join import join_results
from doorstate.evaluation.manifest import read_manifest
from doorstate.evaluation.published import save_results
from doorstate.evaluation.results import ComparisonConfig, Results, RunRecord, order_predictions
from doorstate.rules.base import Detection
from doorstate.training.contents import check_contents, contents_of_comparison, contents_of_run
from doorstate.training.run_folder import RunFolder, run_of

__all__ = ["Results", "has_results", "join_results", "load_part", "load_results", "save_results"]

_DATASETS = "datasets"  # beside published comparisons: manifests of their data sets


def has_results(folder: Path) -> bool:
    """Return True if a folder holds a comparison, as training leaves it or as published, or one run."""
    return (folder / comparison_folder.COMPARISON).is_file() or _is_published(folder) or _is_run(folder)


def load_results(folder: Path, dataset: Path | None = None, folds: int | None = None) -> Results:
    """Load and check the results of a comparison; runs without predictions are listed in `Results.missing`.

    Args:
        folder: comparison folder with `runs/<method>/fold<k>/`, the published form, or the folder of one run, which
            becomes a comparison of one fold.
        dataset: data set folder, if it was moved.
        folds: number of first folds to read; all if not given.

    Raises:
        RunError: no run is finished, a file is missing or damaged, a method tested a sample twice, or a state or a
            test set differs from the manifest of the data set or from the splits, or the data set or the splits have
            changed since the runs began.
    """
    if _is_run(folder):
        return _load_run(folder, dataset)
    is_published = _is_published(folder)
    layout = published if is_published else comparison_folder
    config = _read_config(folder / (published.EXPERIMENT if is_published else comparison_folder.COMPARISON))
    config = config.model_copy(update={"folds": min(config.folds, folds or config.folds)})
    splits = read_splits(folder / layout.SPLITS)
    if len(splits) < config.folds:
        raise RunError(f"{len(splits)} folds, not {config.folds}", path=folder / layout.SPLITS)
    dataset_folder = dataset or _find_dataset(folder, config.dataset, is_published)
    load = _load_published if is_published else _load_runs
    return load(folder, config, dataset_folder, tuple(splits))


def _is_published(folder: Path) -> bool:
    return (folder / published.EXPERIMENT).is_file()


def _is_run(folder: Path) -> bool:
    return RunFolder(folder).config.is_file()


def _read_config(path: Path) -> ComparisonConfig:
    try:
        return ComparisonConfig.model_validate(read_json(path))
    except ValidationError as error:
        raise RunError(first_validation_error(error), path=path, hint="write the comparison again") from error


def _find_dataset(folder: Path, dataset: str, is_published: bool) -> Path:
    beside = [folder.absolute().parent / _DATASETS / Path(dataset).name] if is_published else []
    for candidate in (*beside, Path(dataset), folder / dataset):
        try:
            return manifest_path(candidate).parent
        except DatasetError:
            continue
    raise RunError(f"no manifest in its data set {dataset}", path=folder, field="dataset")


def _load_runs(
    folder: Path, config: ComparisonConfig, dataset_folder: Path, splits: tuple[Mapping[str, Role], ...]
) -> Results:
    _check_contents(folder, config, dataset_folder, splits)
    contents = comparison_folder.read_runs(folder, config.methods, config.folds)
    if not contents:
        raise RunError("no run has predictions yet", path=folder, hint="train at least one network first")

    def path_of(method: str, fold: int) -> Path:
        return run_of(folder, method, fold).predictions

    return _gather(contents, config, dataset_folder, splits, path_of)


def _load_run(folder: Path, dataset: Path | None) -> Results:
    """Load one run as a comparison of one fold."""
    run = RunFolder(folder)
    if not run.predictions.is_file():
        raise RunError("the run has no predictions: it is not finished, or has no test samples", path=folder)
    settings = read_json(run.config)
    rule = settings.get("rule")
    method, fold = rule or settings.get("network"), settings.get("fold")
    if not isinstance(method, str) or not isinstance(fold, int):
        raise RunError("names no network or rule, and no fold", path=run.config)
    name = {"name": f"{folder.resolve().name}, fold {fold}"}
    methods = {"networks": () if rule else (method,), "rules": (method,) if rule else ()}
    defaults = {"num_points": 0, "seed": 0}  # of rules
    try:
        config = ComparisonConfig.model_validate(defaults | settings | name | methods | {"folds": 1})
    except ValidationError as error:
        raise RunError(first_validation_error(error), path=run.config) from error
    splits = read_splits(_splits_of(folder))
    if not 0 <= fold < len(splits):
        raise RunError(f"there is no fold {fold} in its splits", path=folder)
    dataset_folder = dataset or _find_dataset(folder, config.dataset, False)
    check_contents(folder, contents_of_run(dataset_folder, splits[fold]))
    return _gather(
        [comparison_folder.read_run(run, method, 0)],
        config,
        dataset_folder,
        (splits[fold],),
        lambda _, __: run.predictions,
    )


def _splits_of(run: Path) -> Path:
    """Return the splits beside a run of its own, or those of its comparison."""
    own = run / comparison_folder.SPLITS
    return own if own.is_file() else run.resolve().parents[2] / comparison_folder.SPLITS


def _gather(
    contents: Sequence[comparison_folder.RunContents],
    config: ComparisonConfig,
    dataset_folder: Path,
    splits: tuple[Mapping[str, Role], ...],
    path_of: Callable[[str, int], Path],
) -> Results:
    """Join and check the contents of runs."""
    settings: dict[str, Mapping[str, Any]] = {}
    detections: dict[str, dict[str, tuple[Detection, ...]]] = {}
    for run in contents:
        settings.setdefault(run.record.method, run.config)
        detections.setdefault(run.record.method, {}).update(run.detections)
    predictions = pd.concat([run.predictions for run in contents], ignore_index=True)
    manifest = read_manifest(dataset_folder)
    # Head outputs alone name samples without a door, and no states.
    predictions["state"] = predictions["state"].fillna(predictions["sample_id"].map(manifest["state"]))
    results = Results(
        config.model_copy(update={"runs": settings}),
        dataset_folder,
        manifest,
        splits,
        order_predictions(predictions, config),
        tuple(run.record for run in contents),
        detections,
    )
    check_predictions(results, path_of)
    return results


def _check_contents(
    folder: Path, config: ComparisonConfig, dataset_folder: Path, splits: Sequence[Mapping[str, Role]]
) -> None:
    """Raise RunError if the comparison, or one of its runs, began with other data or splits than there are now."""
    check_contents(folder, contents_of_comparison(dataset_folder, splits))
    for fold in range(config.folds):
        contents = contents_of_run(dataset_folder, splits[fold])
        for method in config.methods:
            check_contents(run_of(folder, method, fold).path, contents)


def load_part(
    folder: Path,
    config: Mapping[str, Any],
    splits: Sequence[Mapping[str, Role]],
    predictions: pd.DataFrame,
    runs: Sequence[RunRecord],
) -> Results:
    """Check and return one comparison of a published study.

    Args:
        folder: published study.
        config: configuration of the comparison.
        splits: role of every sample, by fold.
        predictions: rows of this comparison.
        runs: runs of this comparison.

    Raises:
        RunError: the arguments do not fit each other.
    """
    try:
        checked = ComparisonConfig.model_validate(config)
    except ValidationError as error:
        raise RunError(first_validation_error(error), path=folder) from error
    dataset_folder = _find_dataset(folder, checked.dataset, True)
    return _checked(checked, dataset_folder, tuple(splits), predictions, runs, folder / published.PREDICTIONS)


def _load_published(
    folder: Path, config: ComparisonConfig, dataset_folder: Path, splits: tuple[Mapping[str, Role], ...]
) -> Results:
    path = folder / published.PREDICTIONS
    runs = published.read_records(folder / published.METRICS)
    return _checked(config, dataset_folder, splits, published.read_predictions(path), runs, path)


def _checked(
    config: ComparisonConfig,
    dataset_folder: Path,
    splits: tuple[Mapping[str, Role], ...],
    predictions: pd.DataFrame,
    runs: Sequence[RunRecord],
    path: Path,
) -> Results:
    results = Results(
        config,
        dataset_folder,
        read_manifest(dataset_folder),
        splits,
        order_predictions(predictions[predictions["fold"] < config.folds], config),
        tuple(run for run in runs if run.fold < config.folds),
    )
    check_predictions(results, lambda method, fold: path)
    return results
