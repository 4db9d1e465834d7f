# SPDX-License-Identifier: Apache-2.0
"""`doorstate serve`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from doorstate.cli.options import BudgetMs, NetworkNames, PointCount, RuleNames, Threads, WeightsFiles
from doorstate.errors import needs_extra

if TYPE_CHECKING:
    from doorstate.cli.predictors import Methods
    from doorstate.inference.predictor import Predictor
    from doorstate.serving.worker import LoadPredictor

_ALL_ADDRESSES = {"0.0.0.0", "::"}


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; 0.0.0.0 admits other machines.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(help="Port to listen on; 0 chooses a free one.", min=0, max=65535)
    ] = 8000,
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    rule: RuleNames = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    max_megabytes: Annotated[
        float, typer.Option(help="Largest file in MiB; larger ones are refused.", min=0.001)
    ] = 64.0,
    timeout_s: Annotated[
        float, typer.Option(help="Longest time from the head of a request to its response.", min=0.1)
    ] = 30.0,
    work_timeout_s: Annotated[
        float,
        typer.Option(help="Longest time to read and predict one file; then its worker is killed.", min=0.1),
    ] = 10.0,
    queue: Annotated[int, typer.Option(help="Number of files that may wait for a worker.", min=0)] = 16,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Number of worker processes; large files have one more. [default: one a processor]", min=1
        ),
    ] = None,
    client_connections: Annotated[
        int, typer.Option(help="Open connections of one address; more for a proxy in front.", min=1)
    ] = 128,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(help="Name of this machine in requests, besides addresses and localhost; repeatable."),
    ] = None,
    token: Annotated[
        str | None,
        typer.Option(
            envvar="DOORSTATE_TOKEN",
            help="Bearer token that requests must have; the environment variable keeps it out of process lists.",
        ),
    ] = None,
    threads: Threads = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Log requests on standard error.")] = False,
) -> None:
    """Serve predictions over HTTP.

    A client POSTs a file to /predict, and gets JSON.

    \b
    Examples:
      doorstate serve
      doorstate serve --port 9000 --network pointnet2 --points 1024 --workers 2
      DOORSTATE_TOKEN=secret doorstate serve --host 0.0.0.0 --allow-host robot.local
      curl --data-binary @cloud.pcd 'http://127.0.0.1:8000/predict?format=pcd'
    """
    with needs_extra("serve"):
        from doorstate.serving.access import Access
        from doorstate.serving.app import create_app
        from doorstate.serving.limits import Limits
        from doorstate.serving.server import create_server, listen, stop_on_signals
        from doorstate.serving.work_queue import WorkQueue
    from doorstate._jobs import default_workers
    from doorstate.cli.console import stderr
    from doorstate.cli.predictors import Methods

    workers = workers or default_workers()
    limits = Limits(
        max_bytes=int(max_megabytes * 2**20),
        timeout_s=timeout_s,
        work_timeout_s=min(work_timeout_s, timeout_s),
        queue=queue,
        workers=workers,
        client_connections=client_connections,
    )
    threads = threads or max(1, default_workers() // workers)
    access = Access(allow_host or (), token)
    load = _loader(Methods(network, weights, rule), points, budget_ms, threads)
    listener = listen(host, port)
    work_queue = WorkQueue(load, limits)
    try:
        method = work_queue.wait_until_ready()
        server = create_server(create_app(work_queue, access), limits, verbose)
        stop_on_signals(server)
        address = f"[{host}]" if ":" in host else host
        if listener.getsockname()[0] in _ALL_ADDRESSES and token is None:
            stderr.print(
                f"doorstate: every machine that reaches {address} can use this service: there is no --token",
                style="yellow",
                soft_wrap=True,
            )
        print(  # noqa: T201
            f"doorstate: listening on http://{address}:{listener.getsockname()[1]} "
            f"({method.description}, workers: {workers})",
            flush=True,
        )
        server.run(sockets=[listener])
    finally:
        work_queue.close()


def _loader(methods: Methods, points: int | None, budget_ms: float | None, threads: int) -> LoadPredictor:
    """Return the function that loads the predictor in every worker; a time budget is measured here, once."""
    from doorstate.cli.predictors import load_predictor, only_method

    if budget_ms is not None:
        measured = load_predictor(methods, points, budget_ms=budget_ms, threads=threads)
        points = getattr(measured, "num_points", None)
    name, choice = only_method(methods)
    rule = name if choice is None else None
    return partial(_load_in_worker, choice, rule, points, threads)


def _load_in_worker(
    choice: Path | str | None, rule: str | None, points: int | None, threads: int
) -> Predictor:
    from doorstate.inference.backends import needs_torch
    from doorstate.inference.backends.threads import configure_torch
    from doorstate.inference.predictor import Predictor

    configure_torch(threads, used=choice is not None and needs_torch(choice))
    return Predictor.load(choice, rule=rule, num_points=points, threads=threads)
