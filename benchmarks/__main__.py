# SPDX-License-Identifier: Apache-2.0
"""The command `python -m benchmarks`: measure, show a table, store it as JSON and Markdown.

Heavy imports happen inside the commands: every worker imports this file again.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from doorstate.errors import ConfigError, DoorstateError

if TYPE_CHECKING:
    from benchmarks.clouds import Clouds
    from doorstate.evaluation.table import Table

Out = Annotated[Path, typer.Option(help="Folder for the JSON and Markdown files.")]
Networks = Annotated[str, typer.Option(help="Names, separated by commas, or all.")]
Points = Annotated[str, typer.Option(help="Points per cloud, separated by commas.")]
Batch = Annotated[int, typer.Option(help="Clouds of a training step.", min=2)]
Repeats = Annotated[int, typer.Option(help="Rounds in which everything takes turns.", min=1)]
Threads = Annotated[int, typer.Option(help="Threads of every measurement.", min=1)]
Packaged = Annotated[str, typer.Option(help="Whose packaged weights.")]
Doors = Annotated[int, typer.Option("--count", help="Simulated doors, in all states.", min=1)]
Fold = Annotated[int, typer.Option(help="Of protocol paper.", min=0, max=4)]
_ALL_POINTS = "1024,2048,4096"

app = typer.Typer(
    help="Speed of the networks and of the whole way from a raw cloud to a state.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.command()
def networks(
    out: Out,
    networks: Networks = "all",
    points: Points = _ALL_POINTS,
    batch: Batch = 16,
    repeats: Repeats = 3,
    threads: Threads = 2,
    data: Annotated[
        Path | None, typer.Option(help="A prepared data set; simulated clouds if not given.")
    ] = None,
    port_pointnet: Annotated[
        Path | None, typer.Option(help="A checkout of yanx27/Pointnet_Pointnet2_pytorch.")
    ] = None,
    port_dgcnn: Annotated[Path | None, typer.Option(help="A checkout of antao97/dgcnn.pytorch.")] = None,
    pyg: Annotated[bool, typer.Option("--pyg", help="PyTorch Geometric's modules too.")] = False,
    same_allocator: Annotated[
        bool,
        typer.Option("--same-allocator", help="Let every form keep freed memory, not the fast ones alone."),
    ] = False,
    compiled: Annotated[
        bool, typer.Option("--compiled", help="The quickest form through torch.compile too.")
    ] = False,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Measure again what is stored in the folder.")
    ] = False,
) -> None:
    """Training and inference of the five networks against their plain forms and public ports.

    Networks and numbers of points that the folder holds already are kept.

    \b
    Examples:
      python -m benchmarks networks --out reports/speed
      python -m benchmarks networks --networks dgcnn --points 1024 --port-dgcnn ../dgcnn.pytorch --out reports/dgcnn
    """
    from benchmarks.clouds import dataset_clouds, simulated_clouds
    from benchmarks.networks import INFERENCE_BATCHES, Plan, run, table_of
    from benchmarks.store import Store
    from benchmarks.tables import failures
    from doorstate.cli.console import progress_bar

    names, counts = _names(networks), _counts(points)
    given = {"pointnet": port_pointnet, "pointnet2": port_pointnet, "dgcnn": port_dgcnn}
    checkouts = {name: path for name, path in given.items() if path is not None}
    plan = Plan(batch, repeats, threads, checkouts, pyg, same_allocator, compiled)
    settings = _settings(
        batch=batch,
        repeats=repeats,
        threads=threads,
        clouds="simulated" if data is None else str(data),
        ports=" ".join(checkouts),
        pyg=pyg,
        same_allocator=same_allocator,
        compiled=compiled,
    )
    needed = max(batch, *INFERENCE_BATCHES)

    def draw() -> Clouds:
        return (
            simulated_clouds(needed, max(counts))
            if data is None
            else dataset_clouds(data, needed, max(counts))
        )

    store = Store(out, "networks", settings, fresh)
    wanted = [(name, count) for name in names for count in counts]
    with progress_bar("networks") as progress:
        run(plan, wanted, draw, store, progress)
    _tell(table_of(store, wanted, plan), out / "networks.md", failures(store.groups.values()))


@app.command()
def latency(
    out: Out,
    networks: Networks = "all",
    points: Points = _ALL_POINTS,
    threads: Annotated[str, typer.Option(help="Numbers of threads, separated by commas.")] = "1,2",
    repeats: Repeats = 15,
) -> None:
    """From a raw 640 x 480 cloud in memory to a state, stage by stage."""
    from benchmarks.latency import latency_table, measure
    from doorstate.cli.console import progress_bar

    names, counts = _names(networks), _counts(points)
    with progress_bar("latency") as progress:
        rows = measure(names, counts, _integers("--threads", threads, 1), repeats, progress)
    table = latency_table(rows)
    _finish(out, "latency", rows, table, threads=threads, repeats=repeats)


@app.command()
def rules(
    out: Out,
    count: Annotated[int, typer.Option(help="Clouds, of all states.", min=1)] = 60,
    points: Annotated[int, typer.Option(help="Points that networks look at.", min=128)] = 4096,
    repeats: Repeats = 3,
    threads: Threads = 1,
) -> None:
    """From a raw 640 x 480 cloud in memory to a state by rules, and by two networks beside them."""
    from benchmarks.rules import measure, rules_table
    from doorstate.cli.console import progress_bar

    with progress_bar("rules") as progress:
        rows = measure(count, points, threads, repeats, progress)
    _finish(out, "rules", rows, rules_table(rows), clouds=count, threads=threads, repeats=repeats)


@app.command()
def profile(
    out: Out,
    networks: Networks = "all",
    points: Annotated[int, typer.Option(help="Points per cloud.", min=128)] = 4096,
    form: Annotated[str, typer.Option(help="plain (before), fast (after) or both.")] = "both",
    batch: Batch = 16,
    threads: Threads = 2,
) -> None:
    """Where the time of a training step and of an inference goes, by groups of operators."""
    from benchmarks.clouds import simulated_clouds
    from benchmarks.profiling import measure, profile_table, profiled_forms
    from doorstate.cli.console import progress_bar

    if form not in ("plain", "fast", "both"):
        raise ConfigError(f"--form {form}: choose plain, fast or both")
    names = _names(networks)
    clouds = simulated_clouds(batch, points).cut(points)
    with progress_bar("profile") as progress:
        rows = measure(names, profiled_forms(form), clouds, batch, threads, progress)
    table = profile_table(rows, batch)
    _finish(out, "profile", rows, table, points=points, batch=batch, threads=threads)


@app.command()
def knn(out: Out, points: Points = _ALL_POINTS, repeats: Repeats = 5, threads: Threads = 2) -> None:
    """Nearest neighbours in the feature space of DGCNN."""
    from benchmarks.clouds import simulated_clouds
    from benchmarks.neighbours import knn_table, measure
    from doorstate.cli.console import progress_bar

    counts = _counts(points)
    with progress_bar("knn") as progress:
        rows = measure(simulated_clouds(1, max(counts)), counts, repeats, threads, progress)
    table = knn_table(rows)
    _finish(out, "knn", rows, table, threads=threads, repeats=repeats)


@app.command()
def service(
    out: Out,
    seconds: Annotated[float, typer.Option(help="Of every number of clients.", min=0.1)] = 60.0,
    clients: Annotated[str, typer.Option(help="Numbers of clients, separated by commas.")] = "1,4,16",
    network: Packaged = "pointnet2",
    points: Annotated[int | None, typer.Option(help="As trained if not given.", min=128)] = None,
    workers: Annotated[int | None, typer.Option(help="All processors if not given.", min=1)] = None,
) -> None:
    """What `doorstate serve` sustains on this machine: clouds a second, latency, errors, memory.

    The clients run on the same processors as the service.
    """
    from benchmarks.service import measure, service_table
    from doorstate._jobs import default_workers
    from doorstate.cli.console import progress_bar

    counts, workers = _integers("--clients", clients, 1), workers or default_workers()
    options = ["--network", network, "--workers", str(workers)]
    options += [] if points is None else ["--points", str(points)]
    with progress_bar("service") as progress:
        rows = measure(counts, seconds, options, progress)
    table = service_table(rows)
    _finish(
        out, "service", rows, table, network=network, points=points or "", workers=workers, seconds=seconds
    )


def main() -> None:
    """Run the command line; our own exceptions become one line on standard error."""
    try:
        app(prog_name="python -m benchmarks")
    except DoorstateError as error:
        sys.exit(f"benchmarks: {error}")
    except KeyboardInterrupt:
        sys.exit("benchmarks: stopped; the same command goes on from the last finished network")


def _names(networks: str) -> list[str]:
    from doorstate.networks import create_network, list_networks

    names = list_networks() if networks == "all" else [name.strip() for name in networks.split(",")]
    for name in names:
        create_network(name)  # says what is known if this one is not
    return names


def _counts(points: str) -> list[int]:
    return _integers("--points", points, 128)


def _integers(option: str, text: str, least: int) -> list[int]:
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdecimal() and int(word) >= least for word in words):
        raise ConfigError(f"{option} {text}: give whole numbers from {least} up, separated by commas")
    return [int(word) for word in words]


def _settings(**options: Any) -> dict[str, Any]:
    """What results depend on: this machine, these versions, these options."""
    from doorstate.training.environment import describe_environment

    return describe_environment() | options


def _finish(out: Path, name: str, rows: list[dict[str, Any]], table: Table, **options: Any) -> None:
    """Store and show what was measured in one go."""
    from benchmarks.store import write_once

    write_once(out, name, _settings(**options), rows, table)
    _tell(table, out / f"{name}.md")


def _tell(table: Table, path: Path, remarks: Sequence[str] = ()) -> None:
    from doorstate.cli.console import print_table, stdout

    print_table(table.title, table.columns, table.rows)
    for remark in remarks:
        stdout.print(remark, soft_wrap=True)
    stdout.print(f"stored: {path} and {path.with_suffix('.json').name}", soft_wrap=True)


if __name__ == "__main__":
    main()
