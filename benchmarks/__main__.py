# SPDX-License-Identifier: Apache-2.0
"""Command line of the benchmarks: each measures something, prints a table, and stores it as JSON and Markdown.

Heavy imports happen inside the commands, because every worker process imports this file.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from benchmarks.options import (
    describe_run,
    parse_integers,
    parse_networks,
    parse_points,
    port_checkouts,
    print_stored,
    store_results,
)
from doorstate.cli.flags import format_flag
from doorstate.errors import ConfigError, DoorstateError

if TYPE_CHECKING:
    from benchmarks.clouds import Clouds

Out = Annotated[Path, typer.Option(help="Folder of the JSON and Markdown files.")]
Networks = Annotated[str, typer.Option(help="Names separated by commas, or all.")]
Points = Annotated[str, typer.Option(help="Numbers of points per cloud, separated by commas.")]
Batch = Annotated[int, typer.Option(help="Clouds per training step.", min=2)]
Repeats = Annotated[int, typer.Option(help="Rounds of measurements.", min=1)]
Device = Annotated[
    str, typer.Option(metavar="DEVICE", help="Device of the networks: auto, cpu, cuda or cuda:N.")
]
Threads = Annotated[int, typer.Option(help="Threads of torch.", min=1)]
PortPointNet = Annotated[Path | None, typer.Option(help="Checkout of yanx27/Pointnet_Pointnet2_pytorch.")]
PortDGCNN = Annotated[Path | None, typer.Option(help="Checkout of antao97/dgcnn.pytorch.")]
_ALL_POINTS = "1024,2048,4096"

app = typer.Typer(
    help="Measure the speed of networks, rules, predictors and the service.",
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
    data: Annotated[Path | None, typer.Option(help="Prepared data set; default: simulated clouds.")] = None,
    port_pointnet: PortPointNet = None,
    port_dgcnn: PortDGCNN = None,
    pyg: Annotated[bool, typer.Option("--pyg", help="Measure modules of PyTorch Geometric too.")] = False,
    same_allocator: Annotated[
        bool,
        typer.Option("--same-allocator", help="Keep freed memory in all forms, not only in the fast ones."),
    ] = False,
    compiled: Annotated[
        bool, typer.Option("--compiled", help="Measure the fastest form with torch.compile too.")
    ] = False,
    device: Device = "cpu",
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure stored results again.")] = False,
) -> None:
    """Training and inference of the five networks, beside their plain forms and public ports.

    A stopped measurement continues: stored results are kept.

    \b
    Examples:
      python -m benchmarks networks --out reports/speed
      python -m benchmarks networks --networks dgcnn --points 1024 --port-dgcnn ../dgcnn.pytorch --out reports/dgcnn
    """
    from benchmarks.clouds import dataset_clouds, simulated_clouds
    from benchmarks.networks import INFERENCE_BATCHES, Plan, measure_networks, table_of
    from benchmarks.networks_table import list_failures
    from benchmarks.store import Store
    from doorstate._devices import describe_device, resolve_device
    from doorstate.cli.progress import progress_bar

    names, numbers_of_points = parse_networks(networks), parse_points(points)
    checkouts = port_checkouts(port_pointnet, port_dgcnn)
    place = resolve_device(device)
    plan = Plan(batch, repeats, threads, checkouts, pyg, same_allocator, compiled, str(place))
    settings = describe_run(
        batch=batch,
        repeats=repeats,
        threads=threads,
        clouds="simulated" if data is None else str(data),
        ports=" ".join(checkouts),
        pyg=pyg,
        same_allocator=same_allocator,
        compiled=compiled,
        device=describe_device(place),
    )
    count, most_points = max(batch, *INFERENCE_BATCHES), max(numbers_of_points)

    def load_clouds() -> Clouds:
        if data is None:
            return simulated_clouds(count, most_points)
        return dataset_clouds(data, count, most_points)

    store = Store(out, "networks", settings, fresh)
    pairs = [(name, number) for name in names for number in numbers_of_points]
    with progress_bar("networks") as progress:
        measure_networks(plan, pairs, load_clouds, store, progress)
    print_stored(table_of(store, pairs, plan), out / "networks.md", list_failures(store.results.values()))


@app.command()
def latency(
    out: Out,
    networks: Networks = "all",
    points: Points = _ALL_POINTS,
    threads: Annotated[str, typer.Option(help="Numbers of threads, separated by commas.")] = "1,2",
    repeats: Repeats = 15,
) -> None:
    """Latency from a raw 640 x 480 cloud in memory to a state, by stage."""
    from benchmarks.latency import latency_table, measure_latency
    from doorstate.cli.progress import progress_bar

    names, numbers_of_points = parse_networks(networks), parse_points(points)
    numbers_of_threads = parse_integers("threads", threads, 1)
    with progress_bar("latency") as progress:
        rows = measure_latency(names, numbers_of_points, numbers_of_threads, repeats, progress)
    store_results(out, "latency", rows, latency_table(rows), threads=threads, repeats=repeats)


@app.command()
def doorways(
    out: Out,
    weights: Annotated[
        Path | None,
        typer.Option(help="Weights for doorways, .safetensors or .onnx.  [default: the packaged ones]"),
    ] = None,
    network: Annotated[
        str | None, typer.Option(help="Untrained network of this name, in place of weights.")
    ] = None,
    candidates: Annotated[
        str, typer.Option(help="Numbers of candidate doorways, separated by commas.")
    ] = "1,3,5,8",
    threads: Annotated[str, typer.Option(help="Numbers of threads, separated by commas.")] = "1,2",
    repeats: Repeats = 15,
) -> None:
    """Latency from a raw 640 x 480 cloud in memory to every door in it, by stage."""
    from doorstate.inference.backends.threads import configure_torch

    configure_torch(None, used=False)  # as `doorstate predict` does, before torch is imported
    from benchmarks.doorways import doorways_table, measure_doorways
    from doorstate.cli.progress import progress_bar
    from doorstate.inference.predictor import DEFAULT_NETWORK
    from doorstate.networks.packaged import packaged_weights

    if network is not None:
        parse_networks(network)
    source = network or weights or packaged_weights(DEFAULT_NETWORK)
    numbers_of_candidates = parse_integers("candidates", candidates, 1)
    numbers_of_threads = parse_integers("threads", threads, 1)
    with progress_bar("doorways") as progress:
        rows = measure_doorways(source, numbers_of_candidates, numbers_of_threads, repeats, progress)
    table = doorways_table(rows, has_weights=isinstance(source, Path))
    name = f"untrained {network}" if isinstance(source, str) else source.name
    store_results(out, "doorways", rows, table, weights=name, threads=threads, repeats=repeats)


@app.command()
def simulation(
    out: Out,
    presets: Annotated[
        str, typer.Option(help="Presets with their sensors, as preset:sensor, separated by commas.")
    ] = "varied:xtion,building:xtion-matching",
    scenes: Annotated[int, typer.Option(help="Scenes of each preset.", min=1)] = 60,
    points: Annotated[int, typer.Option(help="Points per crop.", min=128)] = 1024,
    device: Annotated[str, typer.Option(help="Device of batched rendering: cpu, cuda, ...")] = "cpu",
    batches: Annotated[str, typer.Option(help="Frames rendered together, separated by commas.")] = "1,8",
    threads: Threads = 1,
) -> None:
    """Time of a simulated frame from its seed to its crops on disk, by stage, and of rendering many at once."""
    from benchmarks.simulation import batches_table, measure_batches, measure_simulation, simulation_table
    from doorstate.cli.progress import progress_bar

    pairs = [name.strip().partition(":")[::2] for name in presets.split(",")]
    numbers = parse_integers("batches", batches, 1)
    with progress_bar("simulation") as progress:
        rows = measure_simulation(pairs, scenes, points, progress)
    store_results(out, "simulation", rows, simulation_table(rows), scenes=scenes, points=points)
    rendered = measure_batches(*pairs[0], scenes, numbers, device, threads)
    table = batches_table(rendered, device)
    store_results(out, "batched_rendering", rendered, table, device=device, threads=threads)


@app.command("live-camera")
def live_camera(
    out: Out,
    hours: Annotated[float, typer.Option(help="Time that passes for the camera.", min=0.001)] = 24.0,
    fps: Annotated[int, typer.Option(help="Images a second.", min=1)] = 30,
) -> None:
    """Memory of a long watch by a live camera, whose time passes as fast as images can be taken."""
    from benchmarks.live_camera import LongWatch, live_camera_table, measure_live_camera
    from doorstate.cli.progress import progress_bar

    with progress_bar("live-camera") as progress:
        rows = measure_live_camera(LongWatch(hours, fps), progress)
    store_results(out, "live-camera", rows, live_camera_table(rows), hours=hours, fps=fps)


@app.command()
def busy(
    out: Out,
    network: Annotated[str, typer.Option(help="Packaged weights.")] = "pointnet2",
    threads: Annotated[str, typer.Option(help="Numbers of threads, separated by commas.")] = "1,2",
    runtimes: Annotated[
        str, typer.Option(help="onnxruntime, torch, or both, separated by a comma.")
    ] = "onnxruntime,torch",
    processes: Annotated[
        str, typer.Option(help="Numbers of processes that keep processors busy, separated by commas.")
    ] = "0,2",
    repeats: Repeats = 25,
) -> None:
    """Latency of an answer while other processes keep the processors busy, by threads and what they do waiting."""
    from benchmarks.busy import RUNTIMES, busy_table, measure_busy
    from doorstate.cli.progress import progress_bar

    names = [name.strip() for name in runtimes.split(",")]
    if not set(names) <= set(RUNTIMES):
        raise ConfigError(f"cannot use {runtimes!r}", field="runtimes", expected=" or ".join(RUNTIMES))
    numbers_of_threads = parse_integers("threads", threads, 1)
    numbers_of_busy = parse_integers("processes", processes, 0)
    with progress_bar("busy") as progress:
        rows = measure_busy(network, names, numbers_of_threads, numbers_of_busy, repeats, progress)
    store_results(out, "busy", rows, busy_table(rows), network=network, processes=processes, repeats=repeats)


@app.command()
def engines(
    out: Out,
    scenes: Annotated[int, typer.Option(help="Scenes to simulate and prepare.", min=8)] = 96,
    pieces: Annotated[int, typer.Option(help="Pieces that do nothing.", min=1)] = 100_000,
    seconds: Annotated[int, typer.Option(help="Pieces of a second for each worker.", min=1)] = 10,
    repeats: Repeats = 3,
    engines: Annotated[str, typer.Option(help="Engines, separated by commas.")] = "processes,ray",
) -> None:
    """Start, overhead, gain of a second worker and very many pieces of both engines: processes and Ray."""
    from benchmarks.engines import ENGINES, EngineBenchmark, engines_table, measure_engines
    from doorstate.cli.progress import progress_bar

    names = [name.strip() for name in engines.split(",")]
    if not set(names) <= set(ENGINES):
        raise ConfigError(f"cannot use {engines!r}", field="engines", expected=" or ".join(ENGINES))
    plan = EngineBenchmark(scenes, pieces, seconds, repeats)
    with progress_bar("engines") as progress:
        rows = measure_engines(plan, names, progress)
    store_results(out, "engines", rows, engines_table(rows), **plan._asdict())


@app.command()
def gpu(
    out: Out,
    device: Device = "cuda",
    networks: Networks = "all",
    port_pointnet: PortPointNet = None,
    port_dgcnn: PortDGCNN = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Few small clouds, to try the check itself.")
    ] = False,
    minutes: Annotated[float, typer.Option(help="Leave out what would start later.", min=0)] = 7.0,
) -> None:
    """Check a CUDA device: parity with the processor, times of networks, searches and rendering, in gpu.json.

    The exit code is 1 if something failed or a network differs from that of the processor, and 77 if there is no CUDA
    device.
    """
    from benchmarks.gpu import check_gpu
    from doorstate._devices import describe_device, resolve_device
    from doorstate._files import write_text
    from doorstate.cli.console import stdout

    try:
        place = resolve_device(device)
    except ConfigError as error:
        if not device.startswith("cuda"):
            raise
        stdout.print(f"nothing was checked: {error.message}", soft_wrap=True)
        raise typer.Exit(77) from None
    names, checkouts = parse_networks(networks), port_checkouts(port_pointnet, port_dgcnn)
    settings = describe_run(device=describe_device(place), quick=quick, ports=" ".join(checkouts))
    results = check_gpu(place, names, checkouts, quick, minutes * 60)
    write_text(out / "gpu.json", json.dumps({"settings": settings} | results, indent=1) + "\n")
    wrong = [f"{row['network']} differs" for row in results["parity"] if not row["is_within_tolerance"]]
    wrong += [f"{row['part']} of {row['name']} failed" for row in results["failed"]]
    stdout.print(f"stored in {out / 'gpu.json'}: {', '.join(wrong) or 'all agree'}", soft_wrap=True)
    raise typer.Exit(int(bool(wrong)))


@app.command()
def rules(
    out: Out,
    count: Annotated[int, typer.Option(help="Clouds, of all states.", min=1)] = 60,
    points: Annotated[int, typer.Option(help="Points per cloud for networks.", min=128)] = 4096,
    repeats: Repeats = 3,
    threads: Threads = 1,
) -> None:
    """Latency from a raw 640 x 480 cloud in memory to a state, of rules and two networks."""
    from benchmarks.rules import measure_rules, rules_table
    from doorstate.cli.progress import progress_bar

    with progress_bar("rules") as progress:
        rows = measure_rules(count, points, threads, repeats, progress)
    store_results(out, "rules", rows, rules_table(rows), clouds=count, threads=threads, repeats=repeats)


@app.command()
def profile(
    out: Out,
    networks: Networks = "all",
    points: Annotated[int, typer.Option(help="Points per cloud.", min=128)] = 4096,
    form: Annotated[str, typer.Option(help="plain, fast or both.")] = "both",
    batch: Batch = 16,
    threads: Threads = 2,
) -> None:
    """Time of a training step and of an inference, by groups of operators."""
    from benchmarks.clouds import simulated_clouds
    from benchmarks.profiling import measure_profile, profile_table, profiled_forms
    from doorstate.cli.progress import progress_bar

    if form not in ("plain", "fast", "both"):
        raise ConfigError(f"no form {form!r}", field="form", expected="plain, fast or both")
    names = parse_networks(networks)
    clouds = simulated_clouds(batch, points).first_points(points)
    with progress_bar("profile") as progress:
        rows = measure_profile(names, profiled_forms(form), clouds, batch, threads, progress)
    store_results(
        out, "profile", rows, profile_table(rows, batch), points=points, batch=batch, threads=threads
    )


@app.command()
def knn(
    out: Out, points: Points = _ALL_POINTS, repeats: Repeats = 5, threads: Threads = 2, device: Device = "cpu"
) -> None:
    """Nearest neighbours in the feature space of DGCNN, by three methods."""
    from benchmarks.clouds import simulated_clouds
    from benchmarks.neighbours import measure_neighbours, neighbours_table
    from doorstate._devices import describe_device, resolve_device
    from doorstate.cli.progress import progress_bar

    numbers_of_points, place = parse_points(points), resolve_device(device)
    with progress_bar("knn") as progress:
        clouds = simulated_clouds(1, max(numbers_of_points))
        rows = measure_neighbours(clouds, numbers_of_points, repeats, threads, progress, str(place))
    described = describe_device(place)
    store_results(
        out, "knn", rows, neighbours_table(rows), threads=threads, repeats=repeats, device=described
    )


@app.command()
def service(
    out: Out,
    seconds: Annotated[float, typer.Option(help="Duration for each number of clients.", min=0.1)] = 60.0,
    clients: Annotated[str, typer.Option(help="Numbers of clients, separated by commas.")] = "1,4,16",
    network: Annotated[str, typer.Option(help="Packaged weights.")] = "pointnet2",
    points: Annotated[
        int | None, typer.Option(help="Points per cloud; default: as trained.", min=128)
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Workers of the service; default: all processors.", min=1)
    ] = None,
) -> None:
    """Throughput, latency, errors and memory of `doorstate serve` on this machine.

    The clients run on the same processors as the service.
    """
    from benchmarks.service import measure_service, service_table
    from doorstate._jobs import default_workers
    from doorstate.cli.progress import progress_bar

    numbers_of_clients, workers = parse_integers("clients", clients, 1), workers or default_workers()
    options = ["--network", network, "--workers", str(workers)]
    options += [] if points is None else ["--points", str(points)]
    with progress_bar("service") as progress:
        rows = measure_service(numbers_of_clients, seconds, options, progress)
    store_results(
        out,
        "service",
        rows,
        service_table(rows),
        network=network,
        points=points or "",
        workers=workers,
        seconds=seconds,
    )


@app.command()
def stream(
    out: Out,
    hours: Annotated[float, typer.Option(help="Simulated length of the stream.", min=0.001)] = 24.0,
    rows: Annotated[int, typer.Option(help="Measurements after the first one.", min=1)] = 12,
    mqtt: Annotated[str, typer.Option(metavar="ADDRESS", help="Broker to publish to.")] = "mqtt://localhost",
) -> None:
    """Memory of a watch and its MQTT publisher over a day of frames, on an accelerated clock."""
    from benchmarks.stream import measure_stream, stream_table
    from doorstate.cli.progress import progress_bar
    from doorstate.mqtt.settings import MqttSettings, parse_address

    settings = MqttSettings.model_validate(parse_address(mqtt).model_dump() | {"camera": "benchmark"})
    with progress_bar("stream") as progress:
        measured = measure_stream(hours, rows, settings, progress)
    store_results(out, "stream", measured, stream_table(measured), hours=hours)


def main() -> None:
    """Run the command line; errors of the package are printed as one line."""
    try:
        app(prog_name="python -m benchmarks")
    except DoorstateError as error:
        sys.exit(f"benchmarks: {error.describe(format_flag)}")
    except KeyboardInterrupt:
        sys.exit("benchmarks: stopped; the same command continues after the last finished network")


if __name__ == "__main__":
    main()
