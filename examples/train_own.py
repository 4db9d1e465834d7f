# SPDX-License-Identifier: Apache-2.0
"""Train a network on your labelled clouds, test it on clouds that it was not trained on, and use it.

    python examples/train_own.py doors/pcd --out trained

The folder has one sub-folder for each state (open, semi-open, closed, in any usual spelling), with thirty clouds at
least and better a thousand. If it is stopped, the same command continues. Clouds of most cameras need
`--axes optical`; for depth images, pass the camera to `ReadOptions`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from doorstate import Predictor, ReadOptions, read_cloud
from doorstate.cli.compare import compare_with_display
from doorstate.cli.progress import progress_bar
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.io.find import find_clouds
from doorstate.training.experiment import load_experiment
from doorstate.training.run_folder import run_of
from doorstate.types import UNITS_M


def main() -> None:
    """Prepare, train, test, predict."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clouds", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--axes", default="ros", choices=("ros", "optical", "opengl"))
    parser.add_argument("--units", default="m", choices=tuple(UNITS_M))
    parser.add_argument("--network", default="pointnet2")
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--epochs", type=int, default=12)
    arguments = parser.parse_args()
    options = ReadOptions(axes=arguments.axes, units_m=UNITS_M[arguments.units])

    with progress_bar("Preparing") as progress:
        prepared = prepare_dataset(
            Preparation(arguments.clouds, CloudSpec(num_points=arguments.points), options=options),
            arguments.out / "prepared",
            progress=progress,
        )
    for row in prepared.rejected:
        print(f"left out {row['file']}: {row['reason']}")
    experiment = load_experiment(
        None,
        {
            "name": "own",
            "dataset": str(arguments.out / "prepared"),
            "networks": (arguments.network,),
            "folds": 1,  # of five; 5 shows the spread of the scores
            "num_points": arguments.points,
            "recipe_changes": {"epochs": arguments.epochs},
        },
    )
    (metrics,) = compare_with_display(experiment, arguments.out / "comparison", jobs=1)
    print(f"macro-F1 {metrics['test_macro_f1']:.3f} on {metrics['test_samples']} test clouds")

    weights = run_of(arguments.out / "comparison", arguments.network, 0).weights
    print(f"weights: {weights}")
    first = find_clouds([arguments.clouds])[0]
    print(f"{first.name}: {Predictor.load(weights)(read_cloud(first, options)).label}")


if __name__ == "__main__":  # the preparation starts processes that import this file
    main()
