# SPDX-License-Identifier: Apache-2.0
"""Comparisons: every network and rule of an experiment on every fold of one split."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import torch
from pydantic import ValidationError

from doorstate._documents import read_json
from doorstate._jobs import Progress, Resources, WorkersOrEngine, engine_of, no_progress, run_pieces
from doorstate._locks import owned_folder
from doorstate.dataset.loader import check_states
from doorstate.dataset.roles import Role
from doorstate.dataset.splits import draw_splits, read_splits, write_splits
from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.errors import ConfigError, RunError, first_validation_error
from doorstate.rules import create_rule
from doorstate.training.config import RunConfig
from doorstate.training.contents import contents_of_comparison, keep_contents
from doorstate.training.experiment import Experiment
from doorstate.training.leakage import check_extra_datasets, check_start_from
from doorstate.training.ranks import ALONE, Ranks
from doorstate.training.rule_run import RuleRunConfig, run_rule
from doorstate.training.run import torch_threads, train_run
from doorstate.training.run_folder import RunFolder, check_same_settings, run_of, write_json


class RunSpec(NamedTuple):
    """One network or rule on one fold, and the folder of its files."""

    method: str
    fold: int
    folder: RunFolder


class _Piece(NamedTuple):
    """Everything that a worker needs for one run."""

    experiment: Experiment
    folder: Path  # of the comparison
    method: str
    fold: int
    threads: int | None
    device: str


def plan_runs(experiment: Experiment, folder: Path) -> list[RunSpec]:
    """Return all runs, fold by fold, so that an unfinished comparison has the same folds of all methods."""
    return [
        RunSpec(method, fold, run_of(folder, method, fold))
        for fold in range(experiment.folds)
        for method in experiment.methods
    ]


def compare(
    experiment: Experiment,
    folder: Path,
    jobs: WorkersOrEngine = 1,
    progress: Progress = no_progress,
    resources: Resources | None = None,
    device: str = "auto",
) -> list[dict[str, Any]]:
    """Train and test every network, and test every rule, on every fold.

    Finished runs are kept and unfinished ones continued.

    Args:
        experiment: experiment to run.
        folder: folder of the comparison: `comparison.json`, `splits.csv`, `runs/<method>/fold<k>/`.
        jobs: number of runs at the same time, or an engine.
        progress: called with the numbers of finished runs and of all runs.
        resources: needs of each run, whose threads are its processors; None: runs share the processors equally.
        device: name of the device that networks are trained on, as for `--device`.

    Returns:
        Metrics of every run.

    Raises:
        RunError: the folder holds another comparison.
        FolderInUseError: another process works in the folder.
    """
    with owned_folder(folder):
        prepare_comparison(experiment, folder)
        runs = plan_runs(experiment, folder)
        engine = engine_of(jobs)
        threads = engine.threads(resources)
        pieces = [_Piece(experiment, folder, run.method, run.fold, threads, device) for run in runs]
        run_pieces(_run_piece, pieces, [run.folder.metrics for run in runs], engine, progress, resources)
        return [run.folder.read_metrics() for run in runs]


def prepare_comparison(experiment: Experiment, folder: Path) -> None:
    """Write the configuration and the splits, or check that the folder holds the same comparison.

    Raises:
        RunError: the folder holds another comparison or began with other data, or the weights to start from were
            trained on test samples.
        ConfigError: a data set does not fit the experiment.
        DatasetError: a data set cannot be opened.
    """
    path, splits_path = folder / "comparison.json", folder / "splits.csv"
    recipes = {
        network: experiment.recipe_of(network).model_dump(mode="json") for network in experiment.networks
    }
    settings = experiment.model_dump(mode="json") | {"recipe": {"name": experiment.recipe} | recipes}
    if path.is_file():
        check_same_settings(path, settings)
    dataset = open_dataset(Path(experiment.dataset))
    check_extra_datasets(experiment, dataset)
    if not splits_path.is_file():
        drawn = draw_splits(dataset.rows, experiment.protocol, experiment.seed)
        if experiment.networks:
            used = [sample for sample, role in drawn[0].items() if role != "unused"]
            check_states(dataset, used, experiment.heads)
        write_splits(splits_path, drawn)
    splits = read_splits(splits_path)
    if experiment.start_from is not None:
        start_from = Path(experiment.start_from)
        check_start_from(experiment, splits, start_from, read_comparison(start_from))
    extra_folders = map(Path, experiment.extra_train_datasets)
    keep_contents(folder, contents_of_comparison(dataset.folder, splits, extra_folders))
    write_json(path, settings)


def read_comparison(folder: Path) -> dict[str, Any]:
    """Return the configuration of a comparison, as an experiment with its recipes in place of their name.

    Raises:
        RunError: the folder holds none, or a damaged one.
    """
    path = folder / "comparison.json"
    if not path.is_file():
        raise RunError("there is no comparison in this folder", path=folder, hint="run it first")
    settings = read_json(path)
    try:
        experiment = Experiment.model_validate(settings | {"recipe": ""})
    except ValidationError as error:
        raise RunError(first_validation_error(error), path=path) from error
    return experiment.model_dump(mode="json") | settings


def train_alone(
    experiment: Experiment,
    folder: Path,
    dataset: PreparedDataset,
    network: str,
    fold: int,
    device: str | torch.device = "auto",
    ranks: Ranks = ALONE,
) -> dict[str, Any]:
    """Draw the splits, unless the folder has them, and train one network on one fold, all in the folder of the run.

    Arguments, result and errors are those of `train_fold`.
    """
    splits_path = folder / "splits.csv"
    with owned_folder(folder) if ranks.is_first else nullcontext():
        if ranks.is_first and not splits_path.is_file():
            write_splits(splits_path, draw_splits(dataset.rows, experiment.protocol, experiment.seed))
        ranks.wait()
        return train_fold(experiment, folder, dataset, network, fold, splits_path, device, ranks)


def train_fold(
    experiment: Experiment,
    folder: Path,
    dataset: PreparedDataset,
    network: str,
    fold: int,
    splits_path: Path,
    device: str | torch.device = "auto",
    ranks: Ranks = ALONE,
) -> dict[str, Any]:
    """Train one network of an experiment on one fold.

    Args:
        experiment: configuration of the experiment.
        folder: folder of the run.
        dataset: data set of the experiment.
        network: name of the network.
        fold: number of the fold, from 0.
        splits_path: `splits.csv` of the comparison.
        device: as for `train_run`.
        ranks: as for `train_run`.

    Returns:
        Metrics of the run.

    Raises:
        ConfigError: there is no such fold.
        DatasetError, RunError, WeightsError: see `train_run`.
    """
    recipe = experiment.recipe_of(network)
    extra_train_datasets = experiment.extra_train_datasets if recipe.epochs else ()
    config = RunConfig(
        network=network,
        network_options=experiment.network_options.get(network, {}),
        dataset=experiment.dataset,
        protocol=experiment.protocol,
        fold=fold,
        num_points=experiment.num_points,
        seed=experiment.seed,
        recipe=recipe,
        start_from=_start_weights(experiment, network, fold),
        heads=experiment.heads_of(network),
        extra_train_datasets=extra_train_datasets,
        train_share=experiment.train_share,
    )
    extra_datasets = [open_dataset(Path(path)) for path in extra_train_datasets]
    return train_run(config, dataset, _roles_of(splits_path, fold), folder, extra_datasets, device, ranks)


def apply_rule(
    experiment: Experiment, folder: Path, dataset: PreparedDataset, rule: str, fold: int, splits_path: Path
) -> dict[str, Any]:
    """Apply one rule of an experiment to one fold; arguments and result are those of `train_fold`.

    Raises:
        ConfigError: there is no such fold.
        DatasetError, RunError: see `run_rule`.
    """
    config = RuleRunConfig(
        rule=rule,
        parameters=create_rule(rule).parameters.model_dump(mode="json"),
        dataset=experiment.dataset,
        protocol=experiment.protocol,
        fold=fold,
    )
    return run_rule(config, dataset, _roles_of(splits_path, fold), folder)


def _roles_of(splits_path: Path, fold: int) -> Mapping[str, Role]:
    splits = read_splits(splits_path)
    if not 0 <= fold < len(splits):
        raise ConfigError(f"there is no fold {fold}", field="fold", expected=f"0 to {len(splits) - 1}")
    return splits[fold]


def _start_weights(experiment: Experiment, network: str, fold: int) -> str | None:
    """Return the weights file that a run starts from; None for random weights."""
    if experiment.start_from is None:
        return None
    start_from = Path(experiment.start_from)
    if network not in read_comparison(start_from)["networks"]:
        return None
    return str(run_of(start_from, network, fold).weights)


def _run_piece(piece: _Piece, path: Path) -> None:
    with torch_threads(piece.threads):
        dataset = open_dataset(Path(piece.experiment.dataset))
        run = (
            apply_rule if piece.method in piece.experiment.rules else partial(train_fold, device=piece.device)
        )
        run(piece.experiment, path.parent, dataset, piece.method, piece.fold, piece.folder / "splits.csv")
