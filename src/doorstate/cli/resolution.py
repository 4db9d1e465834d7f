# SPDX-License-Identifier: Apache-2.0
"""`doorstate resolution`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.engine_options import EngineOptions, with_runs_options

if TYPE_CHECKING:
    from doorstate.training.resolution import ResolutionStudy

_TIMED_CLOUDS, _REPEATS = 9, 3


@with_runs_options
def resolution(
    study: Annotated[Path, typer.Argument(help="Study file (TOML).")],
    out: Annotated[Path | None, typer.Option(help="Folder of the study. [default: runs/NAME]")] = None,
    *,
    runs: EngineOptions,
) -> None:
    """Test trained networks with fewer points.

    Measures accuracy, and the time on the processor of this machine. A study file has the keys dataset, start_from (a
    finished comparison) and points (a list). Optional keys are protocol, networks, folds, seed and heads (as in the
    comparison) and the table [fine_tuning] with fields of a recipe. An interrupted study continues where it stopped.

    \b
    Examples:
      doorstate resolution paper/experiments/resolution.toml
      doorstate resolution paper/experiments/resolution.toml --jobs 2 --out runs/points
    """
    from doorstate._locks import owned_folder
    from doorstate.cli.compare import compare_with_display
    from doorstate.cli.console import print_table
    from doorstate.evaluation.resolution import resolution_table, score_resolution, write_resolution
    from doorstate.evaluation.study import LATENCY, load_study_results
    from doorstate.training.resolution import ResolutionStudy
    from doorstate.training.study import load_study

    settings = load_study(study, ResolutionStudy)
    folder = out or Path("runs") / settings.name
    parts = list(settings.parts())
    with owned_folder(folder), runs.open() as engine:
        for part in parts:
            compare_with_display(part.experiment, folder / part.folder, engine, runs.resources, runs.device)
        if not (folder / LATENCY).is_file():
            _measure_latency(settings, folder)
    results = load_study_results(folder)
    write_resolution(results, folder / "report")
    table = resolution_table(score_resolution(results))
    print_table(table.title, table.columns, table.rows)


def _measure_latency(settings: ResolutionStudy, folder: Path) -> None:
    """Write the median time of each network with each number of points."""
    from doorstate._files import write_csv
    from doorstate._memory import keep_freed_memory
    from doorstate.cli.progress import progress_bar
    from doorstate.dataset.store import open_dataset
    from doorstate.evaluation.study import LATENCY
    from doorstate.inference.budget import median_milliseconds
    from doorstate.inference.predictor import Predictor
    from doorstate.training.run_folder import AS_TRAINED, run_of

    keep_freed_memory()  # as doorstate predict does
    clouds = open_dataset(Path(settings.dataset)).raw_clouds(_TIMED_CLOUDS)
    cases = [(network, points) for network in settings.networks for points in settings.points]
    rows = []
    with progress_bar("Timing") as progress:
        for done, (network, points) in enumerate(cases, 1):
            weights = run_of(folder / f"{AS_TRAINED}-{points}", network, 0).weights
            median_ms = median_milliseconds(Predictor.load(weights, num_points=points), clouds, _REPEATS)
            rows.append({"network": network, "points": str(points), "median_ms": f"{median_ms:.2f}"})
            progress(done, len(cases))
    write_csv(folder / LATENCY, rows)
