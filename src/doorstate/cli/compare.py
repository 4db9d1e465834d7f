# SPDX-License-Identifier: Apache-2.0
"""`doorstate compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.choices import split_names
from doorstate.cli.engine_options import EngineOptions, with_runs_options
from doorstate.cli.options import (
    AsJson,
    Changes,
    ComparedNetworks,
    Epochs,
    HeadNames,
    Protocol,
    RecipeName,
    RuleNames,
    Seed,
    TrainingPoints,
    recipe_changes,
)
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate._jobs import Resources, WorkersOrEngine
    from doorstate.training.experiment import Experiment


@with_runs_options
def compare(
    experiment: Annotated[
        Path | None, typer.Argument(help="Experiment file (TOML); options override its values.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the comparison. [default: runs/NAME]")] = None,
    data: Annotated[Path | None, typer.Option(help="Prepared data set.")] = None,
    protocol: Protocol = None,
    network: ComparedNetworks = None,
    rule: RuleNames = None,
    folds: Annotated[int | None, typer.Option(help="Number of folds to run.", min=1, max=5)] = None,
    points: TrainingPoints = None,
    seed: Seed = None,
    recipe: RecipeName = None,
    epochs: Epochs = None,
    head: HeadNames = None,
    changes: Changes = None,
    as_json: AsJson = False,
    *,
    runs: EngineOptions,
) -> None:
    """Compare networks and rules by cross-validation.

    All methods are tested on the same folds. An interrupted comparison continues where it stopped.

    \b
    Examples:
      doorstate compare paper/experiments/one-fold.toml
      doorstate compare --data data/ogurob-4096 --network pointnet --network dgcnn --rule plane_state --out runs/three
    """
    from doorstate.cli.console import print_json, print_table, stdout
    from doorstate.dataset.splits import EVERYTHING
    from doorstate.dataset.store import open_dataset
    from doorstate.training.experiment import load_experiment

    if experiment is None and data is None:
        raise ConfigError("give an experiment file or --data")
    options: dict[str, Any] = {
        "dataset": None if data is None else str(data),
        "protocol": protocol,
        "networks": tuple(split_names(network)) or None,
        "rules": tuple(split_names(rule)) or None,
        "folds": folds,
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
        "heads": tuple(split_names(head)) or None,
    }
    overrides = {name: value for name, value in options.items() if value is not None}
    changed = recipe_changes(changes, epochs)
    if experiment is None and data is not None:
        overrides.setdefault("name", out.name if out else "comparison")
        overrides.setdefault("num_points", open_dataset(data).num_points)
    settings = load_experiment(experiment, overrides | {"recipe_changes": changed})
    folder = out or Path("runs") / settings.name
    with runs.open() as engine:
        metrics = compare_with_display(settings, folder, engine, runs.resources, runs.device)
    if as_json:
        for run in metrics:
            print_json(run)
        return
    if settings.protocol == EVERYTHING:
        stdout.print(f"trained on all samples, no test; weights are in {folder / 'runs'}")
        return
    print_table(
        f"{settings.name}: macro-F1 on the test folds (protocol {settings.protocol}, {settings.num_points} points)",
        ["method", *(f"fold {fold}" for fold in range(settings.folds)), "mean"],
        [_score_row(method, metrics) for method in settings.methods],
    )
    stdout.print(f"next: doorstate report {folder}")


def compare_with_display(
    experiment: Experiment,
    folder: Path,
    jobs: WorkersOrEngine = 1,
    resources: Resources | None = None,
    device: str = "auto",
) -> list[dict[str, Any]]:
    """Run a comparison with a live display of its progress, and return the metrics of each run."""
    from doorstate._jobs import engine_of
    from doorstate._locks import owned_folder
    from doorstate.cli.run_display import live_runs
    from doorstate.training.comparison import compare as run_comparison
    from doorstate.training.comparison import plan_runs

    recipes = {network: experiment.recipe_of(network) for network in experiment.networks}
    runs = plan_runs(experiment, folder)
    engine = engine_of(jobs)
    at_once = engine.at_once(resources)
    with owned_folder(folder), live_runs(runs, recipes, experiment.num_points, at_once) as progress:
        return run_comparison(experiment, folder, engine, progress, resources, device)


def _score_row(method: str, metrics: list[dict[str, Any]]) -> list[str]:
    scores = [run["test_macro_f1"] for run in metrics if run["method"] == method]
    return [method, *(f"{score:.4f}" for score in scores), f"{sum(scores) / len(scores):.4f}"]
