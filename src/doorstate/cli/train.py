# SPDX-License-Identifier: Apache-2.0
"""`doorstate train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.choices import split_names
from doorstate.cli.options import (
    AsJson,
    Changes,
    Epochs,
    HeadNames,
    Protocol,
    RecipeName,
    Seed,
    TrainedNetwork,
    TrainingPoints,
    recipe_changes,
)


def train(
    network: TrainedNetwork,
    data: Annotated[Path, typer.Option(help="Prepared data set.")],
    out: Annotated[Path, typer.Option(help="Folder of the run to create, or to continue.")],
    fold: Annotated[int, typer.Option(help="Fold to test on.", min=0, max=4)] = 0,
    protocol: Protocol = None,
    points: TrainingPoints = None,
    seed: Seed = None,
    recipe: RecipeName = None,
    epochs: Epochs = None,
    head: HeadNames = None,
    changes: Changes = None,
    as_json: AsJson = False,
) -> None:
    """Train one network on one fold.

    The folder gets weights, predictions and metrics. An interrupted run continues where it stopped.

    \b
    Examples:
      doorstate train --network pointnet2 --data data/ogurob-4096 --points 1024 --epochs 12 --out runs/first
      doorstate train --network dgcnn --data data/ogurob-4096 --recipe authors --set batch_size=16 --out runs/dgcnn
      doorstate train --network pointnet2 --data data/varied-4096 --head door --head angle --out runs/heads
    """
    from doorstate._locks import owned_folder
    from doorstate.cli.console import print_json, stdout
    from doorstate.cli.run_display import live_runs
    from doorstate.dataset.store import open_dataset
    from doorstate.training.comparison import RunSpec, train_alone
    from doorstate.training.experiment import load_experiment
    from doorstate.training.run_folder import RunFolder

    dataset = open_dataset(data)
    given = {"protocol": protocol, "seed": seed, "recipe": recipe}
    settings = {
        "name": out.resolve().name,
        "dataset": str(data),
        "folds": 1,
        "networks": (network,),
        "num_points": points or dataset.num_points,
        "heads": tuple(split_names(head)),
        "recipe_changes": recipe_changes(changes, epochs),
        **{name: value for name, value in given.items() if value is not None},
    }
    experiment = load_experiment(None, settings)
    runs = [RunSpec(network, fold, RunFolder(out))]
    with (
        owned_folder(out),
        live_runs(runs, {network: experiment.recipe_of(network)}, experiment.num_points, 1),
    ):
        metrics = train_alone(experiment, out, dataset, network, fold)
    if as_json:
        print_json(metrics)
        return
    if metrics["test_samples"]:
        summary = (
            f"fold {fold}: test macro-F1 {metrics['test_macro_f1']:.4f}, accuracy {metrics['test_accuracy']:.4f}"
            f" on {metrics['test_samples']} clouds"
        )
    else:
        summary = f"trained on all {metrics['train_samples']} clouds"
    stdout.print(f"{network}, {summary}; weights in {out / 'weights.safetensors'}")
