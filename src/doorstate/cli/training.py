# SPDX-License-Identifier: Apache-2.0
"""Commands that train, compare and report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.options import Changes, Heads, recipe_changes
from doorstate.errors import ConfigError, DatasetError

if TYPE_CHECKING:
    from doorstate.training.comparison import Experiment


def train(
    network: Annotated[str, typer.Argument(help="As doorstate info lists them, such as pointnet2.")],
    data: Annotated[Path, typer.Option(help="A prepared data set.")],
    out: Annotated[Path, typer.Option(help="Folder of the run; a begun run goes on.")],
    fold: Annotated[int, typer.Option(help="Which of the five folds is tested.", min=0, max=4)] = 0,
    protocol: Annotated[
        str, typer.Option(help="paper, by-pose, by-scene, or all, which tests nothing.")
    ] = "paper",
    points: Annotated[int, typer.Option(help="Points of every cloud.", min=128)] = 4096,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    recipe: Annotated[str, typer.Option(help="common or authors.")] = "common",
    epochs: Annotated[int | None, typer.Option(help="In place of the recipe's.", min=1)] = None,
    heads: Heads = None,
    changes: Changes = None,
) -> None:
    """Train one network on one fold: weights, predictions and metrics in one folder.

    \b
    Examples:
      doorstate train pointnet2 --data data/ogurob-4096 --points 1024 --epochs 12 --out runs/first
      doorstate train dgcnn --data data/ogurob-4096 --recipe authors --set batch_size=16 --out runs/dgcnn
      doorstate train pointnet2 --data data/varied-4096 --protocol by-scene --heads door,angle,frame --out runs/heads
    """
    from doorstate.cli.console import live_runs
    from doorstate.cli.console import out as stdout
    from doorstate.dataset.splits import draw_splits, write_splits
    from doorstate.dataset.store import open_dataset
    from doorstate.training.comparison import RunSpec, load_experiment, train_fold
    from doorstate.training.run_folder import RunFolder

    overrides = {
        "name": out.name,
        "dataset": str(data),
        "protocol": protocol,
        "folds": 1,
        "networks": (network,),
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
        "heads": _names(heads) or (),
        "recipe_changes": recipe_changes(changes, epochs),
    }
    experiment = load_experiment(None, overrides)
    dataset = open_dataset(data)
    splits = out / "splits.csv"
    if not splits.is_file():
        write_splits(splits, draw_splits(dataset.rows, protocol, seed))
    runs = [RunSpec(network, fold, RunFolder(out))]
    with live_runs(runs, {network: experiment.recipe_of(network)}, points, 1):
        metrics = train_fold(experiment, out, dataset, network, fold, splits)
    tested = f"trained on all {metrics['train_samples']} clouds"
    if metrics["test_samples"]:
        tested = (
            f"fold {fold}: test macro-F1 {metrics['test_macro_f1']:.4f}, accuracy {metrics['test_accuracy']:.4f}"
            f" on {metrics['test_samples']} clouds"
        )
    stdout.print(f"{network}, {tested}; weights in {out / 'weights.safetensors'}", soft_wrap=True)


def compare(
    experiment: Annotated[
        Path | None, typer.Argument(help="An experiment file; options win over it.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the comparison; runs/NAME if not given.")
    ] = None,
    data: Annotated[Path | None, typer.Option(help="A prepared data set.")] = None,
    protocol: Annotated[str | None, typer.Option(help="paper, by-pose or by-scene.")] = None,
    networks: Annotated[
        str | None, typer.Option(help="Names, separated by commas; the five of the paper if not given.")
    ] = None,
    rules: Annotated[
        str | None, typer.Option(help="Rules to ask beside the networks, separated by commas.")
    ] = None,
    folds: Annotated[
        int | None, typer.Option(help="How many of the five folds to run.", min=1, max=5)
    ] = None,
    points: Annotated[int | None, typer.Option(help="Points of every cloud.", min=128)] = None,
    seed: Annotated[int | None, typer.Option(min=0)] = None,
    recipe: Annotated[str | None, typer.Option(help="common or authors.")] = None,
    epochs: Annotated[int | None, typer.Option(help="In place of the recipe's.", min=1)] = None,
    heads: Heads = None,
    changes: Changes = None,
    jobs: Annotated[int, typer.Option(help="Runs at the same time.", min=1)] = 1,
) -> None:
    """Cross-validate networks on one split; stopped at any moment, it goes on where it was.

    \b
    Examples:
      doorstate compare paper/experiments/one-fold.toml
      doorstate compare --data data/ogurob-4096 --protocol by-pose --networks pointnet,dgcnn --out runs/two
    """
    from doorstate.cli.console import out as stdout
    from doorstate.cli.console import print_table
    from doorstate.dataset.splits import EVERYTHING
    from doorstate.training.comparison import load_experiment

    if experiment is None and data is None:
        raise ConfigError("give an experiment file, or a prepared data set by --data")
    given: dict[str, Any] = {
        "dataset": None if data is None else str(data),
        "protocol": protocol,
        "networks": _names(networks),
        "rules": _names(rules),
        "folds": folds,
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
        "heads": _names(heads),
    }
    overrides = {key: value for key, value in given.items() if value is not None}
    if experiment is None:
        overrides.setdefault("name", out.name if out else "comparison")
    settings = load_experiment(experiment, overrides | {"recipe_changes": recipe_changes(changes, epochs)})
    folder = out or Path("runs") / settings.name
    metrics = compare_live(settings, folder, jobs)
    if settings.protocol == EVERYTHING:
        stdout.print(f"trained on all samples, tested on none: weights in {folder / 'runs'}", soft_wrap=True)
        return
    print_table(
        f"{settings.name}: macro-F1 on the test folds (protocol {settings.protocol}, {settings.num_points} points)",
        ["network", *(f"fold {fold}" for fold in range(settings.folds)), "mean"],
        [_score_row(method, metrics) for method in settings.methods],
    )
    stdout.print(f"next: doorstate report {folder}", soft_wrap=True)


def report(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER...", help="Comparisons on the same samples, or one prepared data set."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write to; report in the first FOLDER if not given.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="The comparison's data set, if it is not where it was.")
    ] = None,
) -> None:
    """Write tables, figures and one self-contained HTML page; of a data set, Table 1 and Figures 1 and 2.

    \b
    Examples:
      doorstate report runs/one-fold
      doorstate report runs/paper runs/related --out reports/all
      doorstate report data/ogurob-4096 --out reports/data
    """
    from doorstate.cli.console import err
    from doorstate.cli.console import out as stdout
    from doorstate.dataset.store import is_prepared
    from doorstate.evaluation.report import write_dataset_figures, write_report

    alone = len(folders) == 1 and not (folders[0] / "comparison.json").is_file()
    if alone and not is_prepared(folders[0]):
        raise DatasetError(
            f"{folders[0]}: holds no comparison (doorstate compare) and no prepared data set (doorstate prepare)"
        )
    target = out or folders[0] / "report"
    with err.status("Writing the report"):
        page = write_dataset_figures(folders[0], target) if alone else write_report(folders, target, data)
    stdout.print(f"report: {page}", soft_wrap=True)


def compare_live(experiment: Experiment, folder: Path, jobs: int) -> list[dict[str, Any]]:
    """Run a comparison and show how far it is; metrics of every run."""
    from doorstate.cli.console import live_runs
    from doorstate.training.comparison import compare as run_comparison
    from doorstate.training.comparison import plan_runs

    recipes = {network: experiment.recipe_of(network) for network in experiment.networks}
    with live_runs(plan_runs(experiment, folder), recipes, experiment.num_points, jobs) as progress:
        return run_comparison(experiment, folder, jobs, progress)


def _names(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(name.strip() for name in text.split(",") if name.strip())


def _score_row(network: str, metrics: list[dict[str, Any]]) -> list[str]:
    scores = [run["test_macro_f1"] for run in metrics if run["method"] == network]
    return [network, *(f"{score:.4f}" for score in scores), f"{sum(scores) / len(scores):.4f}"]
