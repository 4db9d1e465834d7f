# SPDX-License-Identifier: Apache-2.0
"""`doorstate prepare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.engine_options import EngineOptions, with_engine_options
from doorstate.cli.options import LayoutName, ShardOption
from doorstate.cli.prepared_options import (
    AddMissed,
    InputName,
    KeepOutliers,
    KeptCrops,
    MaxDepth,
    PreparedPoints,
    Thin,
    prepared_clouds,
)
from doorstate.cli.reading_options import check_layout, with_reading_options
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.dataset.prepare import PreparationSummary
    from doorstate.io.options import ReadOptions

_MAX_LISTED = 10  # rejected clouds


@with_reading_options
@with_engine_options
def prepare(
    source: Annotated[
        Path, typer.Argument(help="Simulated folder, or folder with one sub-folder of clouds for each state.")
    ],
    out: Annotated[Path, typer.Option(help="Folder to create, or to continue.")],
    points: PreparedPoints = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            "--pose-file",
            help="CSV file with the poses of clouds in state folders: file,x_m,y_m or file,distance_m,robot_angle_deg.",
        ),
    ] = None,
    shard: ShardOption = None,
    layout: LayoutName = None,
    max_depth: MaxDepth = None,
    thin: Thin = False,
    keep_outliers: KeepOutliers = False,
    input_name: InputName = "whole",
    crops: KeptCrops = "all",
    add_missed: AddMissed = False,
    *,
    options: ReadOptions,
    engine: EngineOptions,
) -> None:
    """Clean and sort clouds for training.

    Outliers are removed, and points are sorted by farthest-point sampling: the first N points are a sample of N points.
    With --input doorway, the candidate doorways of each cloud are cropped. An interrupted preparation continues where
    it stopped.

    \b
    Examples:
      doorstate prepare data/ogurob --out data/ogurob-4096
      doorstate prepare data/varied --thin --max-depth-m 5 --out data/varied-4096
      doorstate prepare data/varied --input doorway --add-missed --out data/varied-doorways
      doorstate prepare data/varied --shard 2/8 --out data/varied-4096
      doorstate prepare DeepDoors2 --layout deepdoors2 --out data/deepdoors2
      doorstate prepare ~/OGUROB_DOORS --pose-file poses.csv --axes optical --out data/original
    """
    from doorstate._jobs import Shard
    from doorstate.cli.console import stdout
    from doorstate.cli.progress import progress_bar
    from doorstate.dataset.preparation import Preparation
    from doorstate.dataset.prepare import prepare_dataset, prepare_shard

    check_layout(layout, options)
    if layout is not None and poses is not None:
        raise ConfigError("--pose-file cannot be combined with --layout")
    spec, kept = prepared_clouds(points, max_depth, thin, keep_outliers, input_name, crops, add_missed)
    preparation = Preparation(source, spec, poses, options, layout, kept)
    if shard is not None:
        part = Shard.parse(shard)
        with engine.open() as workers, progress_bar("Preparing") as progress:
            prepare_shard(preparation, out, part, workers, progress)
        stdout.print(f"shard {shard} is in {out}; run the command without --shard to join all shards")
        return
    with engine.open() as workers, progress_bar("Preparing") as progress:
        summary = prepare_dataset(preparation, out, workers, progress)
    print_summary(summary, out)


def print_summary(summary: PreparationSummary, out: Path) -> None:
    """Print the number of prepared clouds; exit with code 1 if clouds were rejected."""
    from doorstate.cli.console import stderr, stdout
    from doorstate.types import LABELS, STATES

    for row in summary.rejected[:_MAX_LISTED]:
        stderr.print(f"rejected {row['file'] or row['sample_id']}: {row['reason']}")
    if summary.rejected:
        stderr.print(f"{len(summary.rejected)} clouds rejected; all are listed in {out / 'rejected.csv'}")
    counts = {name: int((summary.dataset.labels == label).sum()) for label, name in enumerate(LABELS)}
    for state in STATES:
        if not counts[state] and summary.dataset.description.kind == "imported":
            stderr.print(f"no clouds of state {state}: check the name of its folder")
    by_state = ", ".join(f"{count} {name}" for name, count in counts.items() if count or name in STATES)
    stdout.print(
        f"{len(summary.dataset)} clouds of {summary.dataset.num_points} points in {out} ({by_state})"
    )
    if summary.rejected:
        raise typer.Exit(1)
