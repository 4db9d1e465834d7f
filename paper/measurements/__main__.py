# SPDX-License-Identifier: Apache-2.0
"""Command line of the measurements: each writes one Markdown table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.inference.predictor import DEFAULT_NETWORK

if TYPE_CHECKING:
    from doorstate.evaluation.table import Table

Out = Annotated[Path, typer.Option(help="Folder of the table.")]
Network = Annotated[str, typer.Option(help="Packaged weights.")]
Count = Annotated[int, typer.Option(help="Number of simulated doors, in all states.", min=1)]

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=None, help=__doc__)


@app.command()
def gate(
    out: Out = Path("docs/benchmarks"),
    network: Network = "ogurob-pointnet2",
    count: Count = 100,
    dark_count: Annotated[int, typer.Option(help="Number of doors with dark leaves.", min=1)] = 180,
) -> None:
    """Count clouds that the gate rejects, and closed doors reported open, when parts of the cloud are missing."""
    from doorstate.cli.progress import progress_bar

    from .dark_leaves import dark_table, measure_dark_leaves
    from .gate import gate_table, measure_gate

    with progress_bar("gate") as progress:
        faults = gate_table(measure_gate(network, count, progress))
    with progress_bar("dark leaves") as progress:
        dark = dark_table(measure_dark_leaves(DEFAULT_NETWORK, dark_count, progress))
    _write((faults, dark), out / "gate.md", network=network, count=count, dark_count=dark_count)


@app.command()
def ghosts(
    out: Out = Path("docs/benchmarks"),
    network: Network = "pointnet2",
    count: Count = 48,
    results: Annotated[Path, typer.Option(help="Results of every door; those in it are kept.")] = Path(
        "runs/ghosts.csv"
    ),
) -> None:
    """Count doors that ghost points turn into another state, with and without removal of outliers, for all methods."""
    from doorstate.cli.progress import progress_bar

    from .ghost_results import append_results, method_table, read_results, size_table
    from .ghosts import measure_ghosts
    from .outliers import measure_cost, measure_parts, parts_table

    done = {result.door for result in read_results(results)}
    doors = [door for door in range(count) if door not in done]
    with progress_bar("ghosts") as progress:
        for number, of_door in enumerate(measure_ghosts(network, doors), 1):
            append_results(results, of_door)
            progress(number, len(doors))
    found = [result for result in read_results(results) if result.door < count]
    with progress_bar("parts") as progress:
        parts = measure_parts(count, progress)
    tables = (method_table(found), size_table(found, network), parts_table(parts), measure_cost())
    _write(tables, out / "ghosts.md", network=network, count=count)


@app.command()
def doorways(
    out: Out = Path("docs/benchmarks"),
    scenes: Annotated[int, typer.Option(help="Scenes of each preset and sensor.", min=1)] = 50,
) -> None:
    """Count doors of simulated frames that are among the candidate doorways."""
    from doorstate.cli.progress import progress_bar

    from .doorways import doorways_table, errors_table, measure_doorways

    with progress_bar("doorways") as progress:
        doors, frames, hits = measure_doorways(scenes, progress)
    _write((doorways_table(doors, frames), errors_table(hits)), out / "doorway-candidates.md", scenes=scenes)


@app.command()
def doors(
    out: Out = Path("docs/benchmarks"),
    weights: Annotated[
        str, typer.Option(help="Weights for doorways, by name or path; the default network if left out.")
    ] = "",
    scenes: Annotated[int, typer.Option(help="Scenes of each preset and sensor.", min=1)] = 50,
    seed: Annotated[int, typer.Option(help="Seed of the scenes.")] = 1_000_003,
) -> None:
    """Count doors found in simulated frames, right states and false doors, and answers that a tilt changes."""
    from doorstate.cli.progress import progress_bar
    from doorstate.errors import ConfigError

    from .doors import doors_table, load_doorway_predictor, measure_doors, reasons_table
    from .tilted_answers import measure_tilted_answers, tilted_answers_table

    try:
        predictor = load_doorway_predictor(weights or None)
    except ConfigError as error:
        raise typer.BadParameter(str(error), param_hint="--weights") from error
    with progress_bar("tilts") as progress:
        tilted = tilted_answers_table(measure_tilted_answers(predictor, progress))
    with progress_bar("doors") as progress:
        found, frames = measure_doors(predictor, scenes, progress, seed)
    tables = (tilted, doors_table(found, frames), reasons_table(found))
    card = predictor.card
    _write(
        tables, out / "doors.md", network=card.network, trained_on=card.trained_on, scenes=scenes, seed=seed
    )


@app.command("named_doors")
def named_doors(
    out: Out = Path("docs/benchmarks"),
    weights: Annotated[
        str, typer.Option(help="Weights for doorways, by name or path; the default network if left out.")
    ] = "",
    sensor: Annotated[str, typer.Option(help="Sensor model.")] = "d435",
    drives: Annotated[int, typer.Option(help="Drives, each along another corridor.", min=1)] = 1,
    frames: Annotated[int, typer.Option(help="Frames of each drive.", min=2)] = 300,
    asks: Annotated[bool, typer.Option("--ask", help="Ask for doors that were not found.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the corridors.")] = 1_000_003,
) -> None:
    """Count right states of named doors on drives along a corridor, and doors taken for their neighbours."""
    from doorstate.cli.progress import progress_bar
    from doorstate.errors import ConfigError

    from .doors import load_doorway_predictor
    from .named_doors import measure_named_doors, named_doors_table

    try:
        predictor = load_doorway_predictor(weights or None)
    except ConfigError as error:
        raise typer.BadParameter(str(error), param_hint="--weights") from error
    with progress_bar("named doors") as progress:
        results = measure_named_doors(predictor, sensor, drives, frames, asks, progress, seed)
    card = predictor.card
    _write(
        named_doors_table(*results, drives * frames),
        out / "named-doors.md",
        network=card.network,
        trained_on=card.trained_on,
        sensor=sensor,
        drives=drives,
        frames=frames,
        ask=asks,
        seed=seed,
    )


@app.command()
def doorway_gate(
    out: Out = Path("docs/benchmarks"),
    scenes: Annotated[int, typer.Option(help="Scenes of each preset and sensor.", min=1)] = 50,
) -> None:
    """Count true doorways whose state the check confirms, by what their leaf is made of."""
    from doorstate.cli.progress import progress_bar

    from .doorway_gate import doorway_gate_table, measure_doorway_gate

    with progress_bar("doorways") as progress:
        table = doorway_gate_table(measure_doorway_gate(scenes, progress))
    _write(table, out / "doorway-gate.md", scenes=scenes)


@app.command()
def thinning(out: Out = Path("docs/benchmarks"), network: Network = "pointnet2", count: Count = 300) -> None:
    """Compare predictions and times of sampling from a part of the points with those from all points."""
    from doorstate.cli.progress import progress_bar

    from .frames import varied_frames
    from .thinning import measure_thinning, thinning_table

    with progress_bar("thinning") as progress:
        frames = varied_frames(count, progress)
        table = thinning_table(
            measure_thinning(network, ((row.state, frame.points) for row, frame in frames))
        )
    _write(table, out / "thinning.md", network=network)


@app.command()
def sensors(
    out: Out = Path("docs/benchmarks"),
    frames: Annotated[int, typer.Option(help="Frames of each measurement.", min=1)] = 16,
) -> None:
    """Compare noise, steps, shadows and missing pixels of the sensor models with published figures."""
    from doorstate.cli.progress import progress_bar

    from .optical_sensors import NOTE, TITLE, measure_optical
    from .sensors import measure_sensors, sensors_table

    with progress_bar("sensors") as progress:
        table = sensors_table(measure_sensors(range(frames), progress))
    optical = sensors_table(list(measure_optical(range(frames))), TITLE, NOTE)
    _write((table, optical), out / "sensors.md", frames=frames)


@app.command()
def buildings(
    out: Out = Path("docs/benchmarks"),
    scenes: Annotated[int, typer.Option(help="Number of scenes of each preset.", min=1)] = 300,
) -> None:
    """Describe the scenes of buildings: what they contain, and how their doors are seen."""
    from doorstate.cli.progress import progress_bar

    from .buildings import measure_buildings, quantile_table, share_table

    with progress_bar("scenes") as progress:
        measured = measure_buildings(scenes, progress)
    _write((quantile_table(measured), share_table(measured)), out / "buildings.md", scenes=scenes)


@app.command()
def sites(
    out: Out = Path("docs/benchmarks"),
    weights: Annotated[
        list[str] | None,
        typer.Option(help="Weights, by name or path; repeatable. [default: the default network]"),
    ] = None,
    count: Annotated[list[int] | None, typer.Option(help="Labelled frames; repeatable.", min=5)] = None,
    seeds: Annotated[int, typer.Option(help="Number of buildings.", min=1)] = 10,
    sensor: Annotated[str, typer.Option(help="Camera of the buildings.")] = "xtion-matching",
    folder: Annotated[Path, typer.Option(help="Folder of all files; what is done in it is kept.")] = Path(
        "runs/sites"
    ),
) -> None:
    """Adapt weights to labelled frames of three doors of simulated buildings, and test them on three others."""
    from doorstate.cli.progress import progress_bar
    from doorstate.networks.packaged import packaged_weights

    from .sites import learning_table, measure_sites

    names = weights or [DEFAULT_NETWORK]
    paths = {
        Path(name).stem: Path(name).absolute() if name.endswith(".safetensors") else packaged_weights(name)
        for name in names
    }
    with progress_bar("sites") as progress:
        measured = measure_sites(
            paths, range(1, seeds + 1), count or (5, 10, 20, 50), folder, sensor, progress
        )
    _write(learning_table(measured), out / "sites.md", seeds=seeds, sensor=sensor)


@app.command()
def leveling(out: Out = Path("docs/benchmarks"), count: Count = 100) -> None:
    """Compare tilt and floor that clouds show with the true ones, for cameras level, tilted and on their side."""
    from doorstate.cli.progress import progress_bar

    from .leveling import leveling_table, measure_leveling, measure_time

    with progress_bar("leveling") as progress:
        tables = leveling_table(measure_leveling(count, progress)), measure_time()
    _write(tables, out / "leveling.md", count=count)


@app.command()
def export(
    out: Out = Path("docs/benchmarks"),
    runs: Annotated[Path, typer.Option(help="Comparison with the weights to export.")] = Path("runs/paper"),
    fold: Annotated[int, typer.Option(help="Fold of the weights.", min=0, max=4)] = 0,
    points: Annotated[int, typer.Option(help="Points of the exported networks.", min=128)] = 4096,
    count: Count = 102,
) -> None:
    """Compare exported networks with torch, in float32 and with 8-bit matrices."""
    from doorstate.cli.progress import progress_bar
    from doorstate.inference.reference_clouds import reference_clouds
    from doorstate.networks import list_networks
    from doorstate.training.run_folder import run_of

    from .export import export_table, measure_export

    with progress_bar("Simulating") as progress:
        clouds = reference_clouds(count, points, progress)
    rows = []
    for name in list_networks():
        with progress_bar(name) as progress:
            rows += measure_export(run_of(runs, name, fold).weights, clouds, progress)
    _write(export_table(rows), out / "onnx.md", runs=runs, fold=fold, points=points)


def _write(tables: Table | tuple[Table, ...], path: Path, **options: object) -> None:
    """Write tables with the machine, versions and options they were made with."""
    from doorstate._environment import describe_environment
    from doorstate._files import write_text

    settings = ", ".join(
        f"{name} {value}" for name, value in (describe_environment() | options).items() if value != ""
    )
    text = "\n".join(table.to_markdown() for table in (tables if isinstance(tables, tuple) else (tables,)))
    write_text(path, f"{text}\nMade with {settings}.\n")
    typer.echo(f"{path} written")


if __name__ == "__main__":
    app(prog_name="python -m paper.measurements")
