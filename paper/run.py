# SPDX-License-Identifier: Apache-2.0
"""Run experiments from nothing, and repeat one published run."""

from __future__ import annotations

from doorstate.cli.run_display import live_runs
from doorstate.dataset.store import open_dataset
from doorstate.evaluation.metrics import mean_and_deviation
from doorstate.training.comparison import RunSpec, read_comparison, train_fold
from doorstate.training.experiment import load_experiment
from doorstate.training.run_folder import RunFolder, run_of

from . import paths
from .commands import run_doorstate
from .datasets import dataset_commands
from .definition import read_definition
from .published import comparison


def run(name: str, options: str = "") -> None:
    """Make the data of an experiment, run the experiments it starts from, and run it; finished steps are kept.

    Args:
        name: file of `paper/experiments/`, without `.toml`.
        options: further options of the command that runs it, such as `--device cuda`.
    """
    definition = read_definition(name)
    for start in definition.starts_from:
        if not is_finished(start):
            run(start)
    for dataset in definition.datasets:
        for command in dataset_commands(paths.REPOSITORY / dataset):
            run_doorstate(command.arguments, command.prepared)
    run_doorstate(f"{definition.command} paper/experiments/{name}.toml --jobs 2 {options}".rstrip())
    if not definition.is_study and definition.content.get("protocol") != "all":
        run_doorstate(f"report runs/{name}")


def is_finished(name: str) -> bool:
    """Return True if all runs of a comparison are in `runs/`."""
    folder = paths.RUNS / name
    if not (folder / "comparison.json").is_file():
        return False
    config = read_comparison(folder)
    methods = (*config["networks"], *config.get("rules", ()))
    return all(run_of(folder, method, fold).finished for method in methods for fold in range(config["folds"]))


def repeat_run(network: str, fold: int, name: str = "paper") -> tuple[float, float, float]:
    """Train one published run from nothing.

    Args:
        network: network of the comparison.
        fold: fold of the run.
        name: name of the published comparison.

    Returns:
        Test macro F1 now, the published one, and the allowed difference: twice the sample standard deviation over the
        published folds, and at least two samples, since another processor rounds differently and trains other weights.
    """
    published = comparison(name)
    runs = published.runs_of(network)
    _, deviation = mean_and_deviation([record.metric("test_macro_f1") for record in runs])
    record = next(record for record in runs if record.fold == fold)
    allowed = max(2 * deviation, 2 / record.metric("test_samples"))
    experiment = load_experiment(paths.EXPERIMENTS / f"{name}.toml", {})
    folder = RunFolder(paths.RUNS / "repeated" / name / network / f"fold{fold}")
    spec = RunSpec(network, fold, folder)
    with live_runs([spec], {network: experiment.recipe_of(network)}, experiment.num_points, 1):
        metrics = train_fold(
            experiment,
            folder.path,
            open_dataset(paths.REPOSITORY / experiment.dataset),
            network,
            fold,
            paths.RESULTS / name / "splits.csv.gz",
        )
    return metrics["test_macro_f1"], record.metric("test_macro_f1"), allowed
