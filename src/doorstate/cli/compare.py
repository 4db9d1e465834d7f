# SPDX-License-Identifier: Apache-2.0
"""`doorstate compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.options import Changes, Heads, Jobs, recipe_changes, split_names
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.training.experiment import Experiment


def compare(
    experiment: Annotated[
        Path | None, typer.Argument(help="Experiment file (TOML); options override its values.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the comparison. [default: runs/NAME]")] = None,
    data: Annotated[Path | None, typer.Option(help="Prepared data set.")] = None,
    protocol: Annotated[str | None, typer.Option(help="Split protocol: paper, by-pose or by-scene.")] = None,
    networks: Annotated[
        str | None, typer.Option(help="Networks, separated by commas. [default: the five of the paper]")
    ] = None,
    rules: Annotated[str | None, typer.Option(help="Rules, separated by commas. [default: none]")] = None,
    folds: Annotated[int | None, typer.Option(help="Number of folds to run.", min=1, max=5)] = None,
    points: Annotated[int | None, typer.Option(help="Points of each cloud.", min=128)] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the split and of training.", min=0)] = None,
    recipe: Annotated[str | None, typer.Option(help="Training recipe: common or authors.")] = None,
    epochs: Annotated[int | None, typer.Option(help="Epochs. [default: as in the recipe]", min=1)] = None,
    heads: Heads = None,
    changes: Changes = None,
    jobs: Jobs = 1,
) -> None:
    """Compare networks and rules by cross-validation.

    All methods are tested on the same folds. An interrupted comparison continues where it stopped.

    \b
    Examples:
      doorstate compare paper/experiments/one-fold.toml
      doorstate compare --data data/ogurob-4096 --protocol by-pose --networks pointnet,dgcnn --out runs/two
    """
    from doorstate.cli.console import print_table, stdout
    from doorstate.dataset.splits import EVERYTHING
    from doorstate.training.experiment import load_experiment

    if experiment is None and data is None:
        raise ConfigError("give an experiment file or --data")
    options: dict[str, Any] = {
        "dataset": None if data is None else str(data),
        "protocol": protocol,
        "networks": split_names(networks),
        "rules": split_names(rules),
        "folds": folds,
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
        "heads": split_names(heads),
    }
    overrides = {name: value for name, value in options.items() if value is not None}
    if experiment is None:
        overrides.setdefault("name", out.name if out else "comparison")
    settings = load_experiment(experiment, overrides | {"recipe_changes": recipe_changes(changes, epochs)})
    folder = out or Path("runs") / settings.name
    metrics = compare_with_display(settings, folder, jobs)
    if settings.protocol == EVERYTHING:
        stdout.print(f"trained on all samples, no test; weights are in {folder / 'runs'}", soft_wrap=True)
        return
    print_table(
        f"{settings.name}: macro-F1 on the test folds (protocol {settings.protocol}, {settings.num_points} points)",
        ["method", *(f"fold {fold}" for fold in range(settings.folds)), "mean"],
        [_score_row(method, metrics) for method in settings.methods],
    )
    stdout.print(f"next: doorstate report {folder}", soft_wrap=True)


def compare_with_display(experiment: Experiment, folder: Path, jobs: int) -> list[dict[str, Any]]:
    """Run a comparison with a live display of its progress, and return the metrics of each run."""
    from doorstate.cli.run_display import live_runs
    from doorstate.training.comparison import compare as run_comparison
    from doorstate.training.comparison import plan_runs

    recipes = {network: experiment.recipe_of(network) for network in experiment.networks}
    with live_runs(plan_runs(experiment, folder), recipes, experiment.num_points, jobs) as progress:
        return run_comparison(experiment, folder, jobs, progress)


def _score_row(method: str, metrics: list[dict[str, Any]]) -> list[str]:
    scores = [run["test_macro_f1"] for run in metrics if run["method"] == method]
    return [method, *(f"{score:.4f}" for score in scores), f"{sum(scores) / len(scores):.4f}"]
