# SPDX-License-Identifier: Apache-2.0
"""`doorstate serve`."""

from __future__ import annotations

from typing import Annotated

import typer

from doorstate.cli.options import BudgetMs, NetworkNames, PointCount, RuleNames, WeightsFiles
from doorstate.errors import missing_extra


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
    queue: Annotated[int, typer.Option(help="Number of files that may wait for a worker.", min=0)] = 16,
    workers: Annotated[
        int | None, typer.Option(help="Number of worker threads. [default: one a processor]", min=1)
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(
            help="Processor threads of one call to a network. [default: all processors, shared by the workers]",
            min=1,
        ),
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Log requests on standard error.")] = False,
) -> None:
    """Serve predictions over HTTP.

    A client POSTs a file to /predict, and gets JSON.

    \b
    Examples:
      doorstate serve
      doorstate serve --port 9000 --network pointnet2 --points 1024 --workers 2
      curl --data-binary @cloud.pcd 'http://127.0.0.1:8000/predict?format=pcd'
    """
    try:
        from doorstate.serving.app import create_app
        from doorstate.serving.server import create_server, listen
        from doorstate.serving.work_queue import Limits
    except ImportError as error:
        raise missing_extra("serve", "fastapi", "uvicorn") from error
    from doorstate._jobs import default_workers
    from doorstate.cli.predictors import Methods, load_predictor

    workers = workers or default_workers()
    limits = Limits(int(max_megabytes * 2**20), timeout_s, queue, workers)
    threads = threads or max(1, default_workers() // workers)
    predictor = load_predictor(Methods(network, weights, rule), points, budget_ms=budget_ms, threads=threads)
    listener = listen(host, port)
    server = create_server(create_app(predictor, limits), timeout_s, verbose)
    address = f"[{host}]" if ":" in host else host
    print(  # noqa: T201
        f"doorstate: listening on http://{address}:{listener.getsockname()[1]} "
        f"({predictor}, workers: {workers})",
        flush=True,
    )
    server.run(sockets=[listener])
