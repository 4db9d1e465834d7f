# SPDX-License-Identifier: Apache-2.0
"""`doorstate train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.options import Changes, Heads, recipe_changes, split_names


def train(
    network: Annotated[str, typer.Argument(help="Name of a network, such as pointnet2.")],
    data: Annotated[Path, typer.Option(help="Prepared data set.")],
    out: Annotated[Path, typer.Option(help="Folder of the run to create, or to continue.")],
    fold: Annotated[int, typer.Option(help="Fold to test on.", min=0, max=4)] = 0,
    protocol: Annotated[
        str, typer.Option(help="Split protocol: paper, by-pose, by-scene, or all (no test fold).")
    ] = "paper",
    points: Annotated[int, typer.Option(help="Points of each cloud.", min=128)] = 4096,
    seed: Annotated[int, typer.Option(help="Seed of the split and of training.", min=0)] = 0,
    recipe: Annotated[str, typer.Option(help="Training recipe: common or authors.")] = "common",
    epochs: Annotated[int | None, typer.Option(help="Epochs. [default: as in the recipe]", min=1)] = None,
    heads: Heads = None,
    changes: Changes = None,
) -> None:
    """Train one network on one fold.

    The folder gets weights, predictions and metrics. An interrupted run continues where it stopped.

    \b
    Examples:
      doorstate train pointnet2 --data data/ogurob-4096 --points 1024 --epochs 12 --out runs/first
      doorstate train dgcnn --data data/ogurob-4096 --recipe authors --set batch_size=16 --out runs/dgcnn
      doorstate train pointnet2 --data data/varied-4096 --protocol by-scene --heads door,angle,frame --out runs/heads
    """
    from doorstate.cli.console import stdout
    from doorstate.cli.run_display import live_runs
    from doorstate.dataset.splits import draw_splits, write_splits
    from doorstate.dataset.store import open_dataset
    from doorstate.training.comparison import RunSpec, train_fold
    from doorstate.training.experiment import load_experiment
    from doorstate.training.run_folder import RunFolder

    settings = {
        "name": out.name,
        "dataset": str(data),
        "protocol": protocol,
        "folds": 1,
        "networks": (network,),
        "num_points": points,
        "seed": seed,
        "recipe": recipe,
        "heads": split_names(heads) or (),
        "recipe_changes": recipe_changes(changes, epochs),
    }
    experiment = load_experiment(None, settings)
    dataset = open_dataset(data)
    splits = out / "splits.csv"
    if not splits.is_file():
        write_splits(splits, draw_splits(dataset.rows, protocol, seed))
    runs = [RunSpec(network, fold, RunFolder(out))]
    with live_runs(runs, {network: experiment.recipe_of(network)}, points, 1):
        metrics = train_fold(experiment, out, dataset, network, fold, splits)
    if metrics["test_samples"]:
        summary = (
            f"fold {fold}: test macro-F1 {metrics['test_macro_f1']:.4f}, accuracy {metrics['test_accuracy']:.4f}"
            f" on {metrics['test_samples']} clouds"
        )
    else:
        summary = f"trained on all {metrics['train_samples']} clouds"
    stdout.print(f"{network}, {summary}; weights in {out / 'weights.safetensors'}", soft_wrap=True)
