# SPDX-License-Identifier: Apache-2.0
"""Train a network on your own labelled clouds, test it on some that it has not seen, and use it.

    python examples/train_own.py doors/pcd --out trained

The folder has one folder for each state (open, semi-open, closed, in any usual spelling), at least thirty clouds in
all and better a thousand. Stopped at any moment, the same command goes on from there. Clouds of most cameras need
`--frame optical`; for depth images give `ReadOptions` their camera.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from doorstate import Predictor, ReadOptions, read_cloud
from doorstate.cli.compare import compare_with_display
from doorstate.cli.console import progress_bar
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.prepare import prepare_dataset
from doorstate.io.find import find_clouds
from doorstate.training.experiment import load_experiment
from doorstate.training.run_folder import run_of
from doorstate.types import UNITS_M


def main() -> None:
    """Prepare, train, test, answer."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clouds", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--frame", default="body", choices=("body", "optical"))
    parser.add_argument("--units", default="m", choices=tuple(UNITS_M))
    parser.add_argument("--network", default="pointnet2")
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--epochs", type=int, default=12)
    asked = parser.parse_args()
    options = ReadOptions(frame=asked.frame, units_m=UNITS_M[asked.units])

    with progress_bar("Preparing") as progress:
        prepared = prepare_dataset(
            Preparation(asked.clouds, CloudSpec(num_points=asked.points), options=options),
            asked.out / "prepared",
            progress=progress,
        )
    for row in prepared.rejected:
        print(f"left out {row['file']}: {row['reason']}")
    experiment = load_experiment(
        None,
        {
            "name": "own",
            "dataset": str(asked.out / "prepared"),
            "networks": (asked.network,),
            "folds": 1,  # of five; 5 tells how much luck is in it
            "num_points": asked.points,
            "recipe_changes": {"epochs": asked.epochs},
        },
    )
    (metrics,) = compare_with_display(experiment, asked.out / "comparison", jobs=1)
    print(f"macro-F1 {metrics['test_macro_f1']:.3f} on {metrics['test_samples']} clouds not trained on")

    weights = run_of(asked.out / "comparison", asked.network, 0).weights
    print(f"weights: {weights}")
    first = find_clouds([asked.clouds])[0]
    print(f"{first.name}: {Predictor.load(weights)(read_cloud(first, options)).state!r}")


if __name__ == "__main__":  # preparation starts processes, which import this file
    main()
