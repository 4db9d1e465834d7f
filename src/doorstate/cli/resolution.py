# SPDX-License-Identifier: Apache-2.0
"""The command that finds out how many points are enough."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_TIMED_CLOUDS, _REPEATS = 9, 3


def resolution(
    study: Annotated[Path, typer.Argument(help="A study file.")],
    out: Annotated[Path | None, typer.Option(help="Folder of the study; runs/NAME if not given.")] = None,
    jobs: Annotated[int, typer.Option(help="Runs at the same time.", min=1)] = 1,
) -> None:
    """Accuracy and time of finished weights on fewer points; stopped at any moment, it goes on where it was.

    A study file is TOML: dataset, start_from (a finished comparison), points (a list); protocol, networks, folds, seed
    and heads as of that comparison; fine_tuning, fields of a recipe, if weights shall be trained a little too.

    \b
    Examples:
      doorstate resolution paper/experiments/resolution.toml
      doorstate resolution paper/experiments/resolution.toml --jobs 2 --out runs/points
    """
    from doorstate._files import write_csv
    from doorstate._memory import keep_freed_memory
    from doorstate.cli.console import print_table, progress_bar
    from doorstate.cli.training import compare_live
    from doorstate.dataset.store import open_dataset
    from doorstate.evaluation.resolution import (
        LATENCY,
        load_resolution,
        resolution_table,
        write_resolution,
    )
    from doorstate.inference.predictor import Predictor, median_milliseconds
    from doorstate.training.resolution import load_study
    from doorstate.training.run_folder import AS_TRAINED, run_of

    settings = load_study(study)
    folder = out or Path("runs") / settings.name
    for name, experiment in settings.experiments():
        compare_live(experiment, folder / name, jobs)

    if not (folder / LATENCY).is_file():
        keep_freed_memory()  # as `doorstate predict` does
        clouds = open_dataset(Path(settings.dataset)).raw_clouds(_TIMED_CLOUDS)
        timed = []
        with progress_bar("Timing") as update:
            wanted = [(network, points) for network in settings.networks for points in settings.points]
            for done, (network, points) in enumerate(wanted):
                weights = run_of(folder / f"{AS_TRAINED}-{points}", network, 0).weights
                median_ms = median_milliseconds(Predictor.load(weights, points), clouds, _REPEATS)
                timed.append({"network": network, "points": str(points), "median_ms": f"{median_ms:.2f}"})
                update(done + 1, len(wanted))
        write_csv(folder / LATENCY, timed)

    write_resolution(folder, folder / "report")
    table = resolution_table(load_resolution(folder))
    print_table(table.title, table.columns, table.rows)
