# SPDX-License-Identifier: Apache-2.0
"""`doorstate train`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.choices import split_names
from doorstate.cli.options import (
    AsJson,
    Changes,
    Device,
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
    device: Device = "auto",
    devices: Annotated[
        int, typer.Option(help="Devices that train together, each on its share of every batch.", min=1)
    ] = 1,
    as_json: AsJson = False,
) -> None:
    """Train one network on one fold.

    The folder gets weights, predictions and metrics. An interrupted run continues where it stopped. Several devices
    train one network with --devices, or with torchrun on several machines that share the folder.

    \b
    Examples:
      doorstate train --network pointnet2 --data data/ogurob-4096 --points 1024 --epochs 12 --out runs/first
      doorstate train --network dgcnn --data data/ogurob-4096 --recipe authors --set batch_size=16 --out runs/dgcnn
      doorstate train --network dgcnn --data data/ogurob-4096 --device cuda --devices 4 --out runs/four
      doorstate train --network pointnet2 --data data/varied-4096 --head door --head angle --out runs/heads
    """
    from contextlib import nullcontext

    from doorstate._locks import owned_folder
    from doorstate.cli.console import print_json, stdout
    from doorstate.cli.run_display import live_runs
    from doorstate.dataset.store import open_dataset
    from doorstate.training.comparison import RunSpec, train_alone
    from doorstate.training.experiment import load_experiment
    from doorstate.training.ranks import check_devices, is_rank, joined_ranks, launch_ranks
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
    if devices > 1 and not is_rank():
        check_devices(device, devices)
        launch_ranks(devices, sys.argv[1:])
        return
    runs = [RunSpec(network, fold, RunFolder(out))]
    recipes = {network: experiment.recipe_of(network)}
    with joined_ranks(device) as (place, ranks):
        with (
            owned_folder(out) if ranks.is_first else nullcontext(),
            live_runs(runs, recipes, experiment.num_points, 1) if ranks.is_first else nullcontext(),
        ):
            metrics = train_alone(experiment, out, dataset, network, fold, place, ranks)
        if not ranks.is_first:
            return
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
