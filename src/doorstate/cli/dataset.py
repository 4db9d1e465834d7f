# SPDX-License-Identifier: Apache-2.0
"""Commands that make data sets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.cli.options import (
    DepthScale,
    Focal,
    Frame,
    IntrinsicsFile,
    LayoutName,
    Roll,
    Units,
    Workers,
    read_options,
)
from doorstate.clouds.preparation import CloudSpec
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.dataset.prepare import PreparationSummary

ShardOption = Annotated[
    str | None, typer.Option(help="Do only this share, such as 2/8; without it all shares are joined.")
]


PreparedPoints = Annotated[int, typer.Option(help="Points kept of every cloud.", min=128)]
MaxDepth = Annotated[
    float | None,
    typer.Option("--max-depth-m", help="Leave out points farther ahead, in metres.", min=0.5),
]
Thin = Annotated[
    bool,
    typer.Option(
        "--thin", help="Sample from every second, third ... row and column of images, as predict does."
    ),
]


def simulate(
    out: Annotated[Path, typer.Option(help="Folder to make, or to go on with.")],
    preset: Annotated[
        str,
        typer.Option(
            help="ogurob, ogurob-fixed, ogurob-away (one door, many poses); varied, varied-angles, cluttered, no-door "
            "(many scenes)."
        ),
    ] = "ogurob",
    poses: Annotated[
        int | None, typer.Option(help="How many of ogurob's 1353 robot poses; all if not given.")
    ] = None,
    scenes: Annotated[
        int | None, typer.Option(help="How many scenes of the other presets; 1000 if not given.", min=1)
    ] = None,
    seed: Annotated[int, typer.Option(help="Everything random is drawn from it.", min=0)] = 0,
    sensor: Annotated[
        str,
        typer.Option(help="none, gaussian, gaussian:METRES, xtion, kinect, d435 or deepdoors2."),
    ] = "none",
    keep: Annotated[
        list[str] | None, typer.Option(help="Raw files to keep: pcd, depth, image; repeatable.")
    ] = None,
    workers: Workers = None,
    shard: ShardOption = None,
    prepared: Annotated[
        Path | None,
        typer.Option(help="Prepare the clouds into this folder as well, as 'doorstate prepare' does."),
    ] = None,
    points: PreparedPoints = 4096,
    max_depth: MaxDepth = None,
    thin: Thin = False,
) -> None:
    """Simulate doors seen by a depth camera: a manifest whose every row rebuilds its cloud.

    \b
    Examples:
      doorstate simulate --out data/ogurob
      doorstate simulate --out data/small --poses 60 --keep pcd --keep image
      doorstate simulate --preset varied --scenes 10000 --out data/varied
      doorstate simulate --preset varied --scenes 10000 --sensor xtion --out data/varied-xtion
      doorstate simulate --preset cluttered --scenes 40000 --shard 2/8 --out data/cluttered
      doorstate simulate --preset varied --sensor d435 --out data/d435 --prepared data/d435-4096 --thin --max-depth-m 5
    """
    from doorstate._jobs import Shard
    from doorstate.cli.console import err, print_table, progress_bar
    from doorstate.cli.console import out as stdout
    from doorstate.dataset.prepare import Preparation
    from doorstate.dataset.simulated import Sampler, simulate_prepared
    from doorstate.dataset.strata import BANDS, REGIONS, distance_band, region
    from doorstate.simulation.generate import PRESETS
    from doorstate.simulation.run import simulate_dataset, simulate_shard
    from doorstate.simulation.settings import RAW_KINDS, settings_for

    unknown = [kind for kind in keep or [] if kind not in RAW_KINDS]
    if unknown:
        raise ConfigError(f"--keep {unknown[0]}: choose from {', '.join(RAW_KINDS)}")
    kinds: Any = tuple(kind for kind in RAW_KINDS if kind in (keep or []))
    settings = settings_for(preset, seed, poses, scenes, kinds, sensor)
    asked = Preparation(out, CloudSpec(num_points=points, thin=thin, max_depth_m=max_depth))
    if prepared is None and asked != Preparation(out):
        raise ConfigError("--points, --max-depth-m and --thin are for --prepared FOLDER: give it too")
    if shard is not None:
        share = Shard.parse(shard)
        with progress_bar("Simulating") as progress:
            simulate_shard(out, settings, share, workers, progress, Sampler(asked) if prepared else None)
        stdout.print(f"share {shard} is in {out}; when all are, the same command without --shard joins them")
        return
    with progress_bar("Simulating") as progress:
        if prepared is not None:
            summary = simulate_prepared(settings, asked, prepared, workers, progress)
        rows = simulate_dataset(out, settings, workers, progress)
    counts = [
        (distance_band(float(row["distance_m"])), region(float(row["robot_angle_deg"]))) for row in rows
    ]
    print_table(
        "Clouds by distance (m) and angle region"
        + (" (Table 1; a third of each per state)" if preset in PRESETS else ""),
        ["distance", *REGIONS, "all"],
        [
            [
                band,
                *(str(counts.count((band, name))) for name in REGIONS),
                str(sum(c[0] == band for c in counts)),
            ]
            for band in BANDS
        ],
    )
    twins = sum(bool(row["same_image_as"]) for row in rows)
    if twins:
        err.print(
            f"{twins} frames look the same in another state: nobody can tell them apart (same_image_as)"
        )
    if prepared is not None:
        stdout.print(f"{len(rows)} samples in {out}")
        _tell(summary, prepared, points)
        return
    stdout.print(f"{len(rows)} samples in {out}; next: doorstate prepare {out} --out {out}-4096")


def prepare(
    source: Annotated[Path, typer.Argument(help="A simulated folder, or class folders of clouds.")],
    out: Annotated[Path, typer.Option(help="Folder to make, or to go on with.")],
    points: PreparedPoints = 4096,
    poses: Annotated[
        Path | None,
        typer.Option(help="CSV of poses for class folders: file,x_m,y_m or file,distance_m,robot_angle_deg."),
    ] = None,
    frame: Frame = "body",
    roll: Roll = 0,
    units: Units = "m",
    depth_scale: DepthScale = 0.001,
    intrinsics: IntrinsicsFile = None,
    fx: Focal = None,
    fy: Focal = None,
    cx: Focal = None,
    cy: Focal = None,
    workers: Workers = None,
    shard: ShardOption = None,
    layout: LayoutName = None,
    max_depth: MaxDepth = None,
    thin: Thin = False,
) -> None:
    """Clean clouds and bring them into farthest-point order, ready for training.

    \b
    Examples:
      doorstate prepare data/ogurob --out data/ogurob-4096
      doorstate prepare data/varied --thin --max-depth-m 5 --out data/varied-4096
      doorstate prepare data/varied --shard 2/8 --out data/varied-4096
      doorstate prepare DeepDoors2 --layout deepdoors2 --out data/deepdoors2
      doorstate prepare ~/OGUROB_DOORS --poses poses.csv --frame optical --out data/original
    """
    from doorstate._jobs import Shard
    from doorstate.cli.console import out as stdout
    from doorstate.cli.console import progress_bar
    from doorstate.dataset.prepare import Preparation, prepare_dataset, prepare_shard

    options = read_options(frame, roll, units, depth_scale, intrinsics, (fx, fy, cx, cy), layout)
    if layout is not None and poses is not None:
        raise ConfigError("--poses is for class folders: leave it out with --layout")
    spec = CloudSpec(num_points=points, thin=thin, max_depth_m=max_depth)
    asked = Preparation(source, spec, poses, options, layout)
    if shard is not None:
        share = Shard.parse(shard)
        with progress_bar("Preparing") as progress:
            prepare_shard(asked, out, share, workers, progress)
        stdout.print(f"share {shard} is in {out}; when all are, the same command without --shard joins them")
        return
    with progress_bar("Preparing") as progress:
        summary = prepare_dataset(asked, out, workers, progress)
    _tell(summary, out, points)


def _tell(summary: PreparationSummary, out: Path, points: int) -> None:
    """Say what was prepared; exit code 1 if something was left out."""
    from doorstate.cli.console import err
    from doorstate.cli.console import out as stdout
    from doorstate.types import NO_DOOR, STATES

    for row in summary.rejected[:10]:
        err.print(f"left out {row['file'] or row['sample_id']}: {row['reason']}")
    if summary.rejected:
        err.print(f"{len(summary.rejected)} clouds left out, all in {out / 'rejected.csv'}")
    names = (*STATES, NO_DOOR)
    counts = {name: int((summary.dataset.labels == label).sum()) for label, name in enumerate(names)}
    for state in STATES:
        if not counts[state] and summary.dataset.description.kind == "imported":
            err.print(f"no clouds of state {state}: is its folder named in a way we do not know?")
    shares = ", ".join(f"{count} {name}" for name, count in counts.items() if count or name != NO_DOOR)
    stdout.print(f"{len(summary.dataset)} clouds of {points} points in {out} ({shares})", soft_wrap=True)
    if summary.rejected:
        raise typer.Exit(1)


def join(
    sources: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Prepared data sets.")],
    out: Annotated[Path, typer.Option(help="Folder to make.")],
) -> None:
    """Put prepared data sets behind one another, as one to train on.

    \b
    Example:
      doorstate join data/varied-4096 data/cluttered-4096 data/no-door-4096 --out data/mixture-4096
    """
    from doorstate.cli.console import out as stdout
    from doorstate.dataset.join import join_datasets

    joined = join_datasets(sources, out)
    stdout.print(f"{len(joined)} clouds of {joined.num_points} points in {out}", soft_wrap=True)
