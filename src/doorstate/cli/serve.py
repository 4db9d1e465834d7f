# SPDX-License-Identifier: Apache-2.0
"""The command that answers over HTTP."""

from __future__ import annotations

import math
import signal
import socket
from typing import Annotated

import typer

from doorstate.cli.options import BudgetMs, Network, PointCount, RuleName, Weights
from doorstate.errors import DoorstateError, missing_extra

# Longer than clients (httpx: 5 s) and proxies (nginx: 60 s) keep an idle connection. If the service closes it first, a
# request sent at that moment is lost to a reset.
KEEP_ALIVE_S = 75


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; 0.0.0.0 lets other machines in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="0 takes any that is free.", min=0, max=65535)] = 8000,
    network: Network = None,
    weights: Weights = None,
    rule: RuleName = None,
    points: PointCount = None,
    budget_ms: BudgetMs = None,
    max_megabytes: Annotated[float, typer.Option(help="Larger files are refused.", min=0.001)] = 64.0,
    timeout_s: Annotated[
        float, typer.Option(help="From the head of a request to its answer; slower ones end.", min=0.1)
    ] = 30.0,
    queue: Annotated[int, typer.Option(help="Files that may wait for a worker.", min=0)] = 16,
    workers: Annotated[
        int | None, typer.Option(help="Files in work at a time; all processors if not given.", min=1)
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Say every request on standard error.")] = False,
) -> None:
    """Answer clouds over HTTP: POST a file to /predict, get JSON (docs/service.md).

    \b
    Examples:
      doorstate serve
      doorstate serve --port 9000 --network pointnet2 --points 1024 --workers 2
      curl --data-binary @cloud.pcd 'http://127.0.0.1:8000/predict?format=pcd'
    """
    try:
        import uvicorn

        from doorstate.serving.service import create_app
        from doorstate.serving.workload import Limits
    except ImportError as error:
        raise missing_extra("serve", "fastapi", "uvicorn") from error
    from doorstate._jobs import default_workers
    from doorstate.inference.loading import load_predictor

    workers = workers or default_workers()
    limits = Limits(int(max_megabytes * 2**20), timeout_s, queue, workers)
    threads = max(1, default_workers() // workers)
    if rule is None and (weights is None or weights.suffix != ".onnx"):
        import torch

        torch.set_num_threads(threads)
    predictor = load_predictor(network, weights, rule, points, budget_ms=budget_ms, threads=threads)
    listening = _listen(host, port)
    server = uvicorn.Server(
        uvicorn.Config(
            create_app(predictor, limits),
            http="h11",
            ws="none",
            log_level="info" if verbose else "warning",
            access_log=verbose,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=math.ceil(timeout_s),
        )
    )
    # Uvicorn stops at these signals, and sends them again when it has stopped: that is no failure.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: setattr(server, "should_exit", True))
    address = f"[{host}]" if ":" in host else host
    print(  # noqa: T201
        f"doorstate: listening on http://{address}:{listening.getsockname()[1]} "
        f"({predictor}, workers: {workers})",
        flush=True,
    )
    server.run(sockets=[listening])


def _listen(host: str, port: int) -> socket.socket:
    try:
        listening = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET
        )
    except OSError as error:
        reason = str(error.strerror or error).partition(" (while")[0]  # Python repeats the address there
        raise DoorstateError(f"cannot listen on {host}, port {port}: {reason}") from error
    # Connections inherit it. asyncio sets it for its own sockets only; without, the second part of every answer waits
    # 40 ms for the client to acknowledge the first.
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listening
