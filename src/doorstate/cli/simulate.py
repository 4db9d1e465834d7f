# SPDX-License-Identifier: Apache-2.0
"""`doorstate simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.choices import PRESET, RAW_KIND, SENSOR, split_names
from doorstate.cli.engine_options import EngineOptions, with_engine_options
from doorstate.cli.options import ShardOption
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
from doorstate.errors import ConfigError


@with_engine_options
def simulate(
    out: Annotated[Path, typer.Option(help="Folder to create, or to continue.")],
    preset: Annotated[
        str,
        typer.Option(
            parser=PRESET,
            metavar="NAME",
            help="Scenes: {presets}. The ogurob presets show one door from many poses, site six doors of one building, "
            "the others many rooms.",
        ),
    ] = "ogurob",
    poses: Annotated[
        int | None, typer.Option(help="Number of robot poses of the ogurob presets. [default: all 1353]")
    ] = None,
    scenes: Annotated[
        int | None,
        typer.Option(
            help="Number of scenes of the other presets, and of views of site. [default: 1000]", min=1
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of all random numbers.", min=0)] = 0,
    sensor: Annotated[
        str,
        typer.Option(
            parser=SENSOR,
            metavar="NAME",
            help="Noise of the depth camera: {sensors}; gaussian:0.02 has a standard deviation of 0.02 m.",
        ),
    ] = "none",
    keep: Annotated[
        list[str] | None,
        typer.Option(parser=RAW_KIND, metavar="NAME", help="Raw files to write: {raw_kinds}; repeatable."),
    ] = None,
    shard: ShardOption = None,
    prepared: Annotated[
        Path | None,
        typer.Option(help="Folder for prepared clouds, as written by doorstate prepare."),
    ] = None,
    points: PreparedPoints = None,
    max_depth: MaxDepth = None,
    thin: Thin = False,
    keep_outliers: KeepOutliers = False,
    input_name: InputName = "whole",
    crops: KeptCrops = "all",
    add_missed: AddMissed = False,
    *,
    engine: EngineOptions,
) -> None:
    """Simulate doors seen by a depth camera.

    The folder gets a manifest with one row for each cloud; every cloud can be rebuilt from its row. Depth images get an
    index.csv with their camera, from which predict and evaluate read them. An interrupted simulation continues where
    it stopped.

    \b
    Examples:
      doorstate simulate --out data/ogurob
      doorstate simulate --out data/small --poses 60 --keep pcd --keep image
      doorstate simulate --preset varied --scenes 10000 --out data/varied
      doorstate simulate --preset varied --scenes 10000 --sensor xtion --out data/varied-xtion
      doorstate simulate --preset site --scenes 60 --seed 7 --keep depth --out data/site-7
      doorstate simulate --preset cluttered --scenes 40000 --shard 2/8 --out data/cluttered
      doorstate simulate --preset varied --sensor d435 --out data/d435 --prepared data/d435-4096 --thin --max-depth-m 5
    """
    from doorstate._jobs import Shard
    from doorstate.cli.console import stderr, stdout
    from doorstate.cli.prepare import print_summary
    from doorstate.cli.progress import progress_bar
    from doorstate.dataset.preparation import Preparation
    from doorstate.dataset.simulated import Sampler, simulate_prepared
    from doorstate.simulation.settings import RAW_KINDS, settings_for
    from doorstate.simulation.writer import simulate_dataset, simulate_shard

    kept = split_names(keep)
    kinds = tuple(kind for kind in RAW_KINDS if kind in kept)
    settings = settings_for(preset, seed, poses, scenes, kinds, sensor)
    spec, of_doorways = prepared_clouds(points, max_depth, thin, keep_outliers, input_name, crops, add_missed)
    preparation = Preparation(out, spec, crops=of_doorways)
    if prepared is None and preparation != Preparation(out):
        raise ConfigError("options of prepared clouds need --prepared")
    if shard is not None:
        part = Shard.parse(shard)
        with engine.open() as workers, progress_bar("Simulating") as progress:
            simulate_shard(out, settings, part, workers, progress, Sampler(preparation) if prepared else None)
        stdout.print(f"shard {shard} is in {out}; run the command without --shard to join all shards")
        return
    with engine.open() as workers, progress_bar("Simulating") as progress:
        summary = (
            None
            if prepared is None
            else simulate_prepared(settings, preparation, prepared, workers, progress)
        )
        rows = simulate_dataset(out, settings, workers, progress)
    _print_counts(rows)
    twins = sum(bool(row["same_image_as"]) for row in rows)
    if twins:
        stderr.print(f"{twins} frames have the same image in another state (column same_image_as)")
    if prepared is None or summary is None:
        stdout.print(f"{len(rows)} samples in {out}; next: doorstate prepare {out} --out {out}-4096")
    else:
        stdout.print(f"{len(rows)} samples in {out}")
        print_summary(summary, prepared)


def _print_counts(rows: list[dict[str, str]]) -> None:
    """Print the number of clouds by distance and region, as in Table 1 of the paper."""
    from doorstate.cli.console import print_table
    from doorstate.dataset.strata import BANDS, REGIONS, distance_band, region

    counts = [
        (distance_band(float(row["distance_m"])), region(float(row["robot_angle_deg"]))) for row in rows
    ]
    print_table(
        "Clouds by distance (m) and region",
        ["distance", *REGIONS, "all"],
        [
            [
                band,
                *(str(counts.count((band, name))) for name in REGIONS),
                str(sum(row_band == band for row_band, _ in counts)),
            ]
            for band in BANDS
        ],
    )
