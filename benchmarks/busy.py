# SPDX-License-Identifier: Apache-2.0
"""Latency of one answer while other processes keep the processors busy, by threads and by what waiting threads do."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from benchmarks.clouds import raw_cloud
from benchmarks.store import Result
from benchmarks.timing import format_ms, summarize_ms
from benchmarks.workers import Worker
from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.inference.backends import Backend, load_backend
from doorstate.inference.backends.onnx_backend import OnnxBackend
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.networks.packaged import packaged_graph, packaged_weights

RUNTIMES = ("onnxruntime", "torch")
WAITING = ("sleep", "spin")
_REST_S = 0.1  # threads that spin after a call stop before the next form is measured
_NOTE = (
    "Milliseconds of one answer from a simulated 640 × 480 cloud in memory, median (90th percentile). *Busy*: "
    "processes that compute all the time beside it. *Waiting threads*: *sleep* is `session.intra_op.allow_spinning` 0 "
    "of onnxruntime and `OMP_WAIT_POLICY=PASSIVE` of torch, *spin* what both libraries do on their own. All forms take "
    "turns; × is the median ratio, within a turn, to onnxruntime with most threads that sleep."
)


class Form(NamedTuple):
    """Runtime with its number of threads, and what these do while they wait."""

    runtime: str
    threads: int
    waiting: str


class Answers:
    """Predictor in a process of its own."""

    def __init__(self, form: Form, network: str) -> None:
        backend = _backend(form, network)
        self._predictor, self._cloud = NetworkPredictor.for_card(backend.card)(backend), raw_cloud()
        self._predictor.warm_up()
        self.milliseconds()

    def milliseconds(self) -> float:
        """Return the time of one answer."""
        started = time.perf_counter()
        self._predictor(self._cloud)
        return (time.perf_counter() - started) * 1000


def _backend(form: Form, network: str) -> Backend:
    if form.runtime == "onnxruntime":
        weights, spinning = packaged_weights(network), form.waiting == "spin"
        return OnnxBackend(packaged_graph(network), form.threads, weights=weights, spinning=spinning)
    import torch

    torch.set_num_threads(form.threads)
    return load_backend(network, backend="torch")


def measure_busy(
    network: str,
    runtimes: Sequence[str],
    numbers_of_threads: Sequence[int],
    numbers_of_busy: Sequence[int],
    repeats: int,
    progress: Progress,
) -> list[Result]:
    """Return the times of every form, one row per form and number of busy processes.

    Args:
        network: name of packaged weights.
        runtimes: some of `RUNTIMES`.
        numbers_of_threads: threads of a call; a single thread never waits for others, so it has one form.
        numbers_of_busy: processes that compute all the time.
        repeats: turns of all forms.
        progress: called with finished and all turns.
    """
    forms = [
        Form(runtime, threads, waiting)
        for runtime in runtimes
        for threads in numbers_of_threads
        for waiting in (WAITING if threads > 1 else WAITING[:1])
    ]
    rows = []
    with ExitStack() as workers:
        answers = {form: workers.enter_context(_worker(form, network)) for form in forms}
        for worker in answers.values():
            worker.call("milliseconds")
        for number, busy in enumerate(numbers_of_busy):
            with _busy_processes(busy):
                turns = []
                for turn in range(repeats):
                    progress(number * repeats + turn, repeats * len(numbers_of_busy))
                    turns.append(_turn(answers))
            rows += [
                {**form._asdict(), "busy": busy, "milliseconds": [turn[form] for turn in turns]}
                for form in forms
            ]
    progress(repeats * len(numbers_of_busy), repeats * len(numbers_of_busy))
    return rows


def _turn(answers: dict[Form, Worker]) -> dict[Form, float]:
    times = {}
    for form, worker in answers.items():
        time.sleep(_REST_S)
        times[form] = worker.call("milliseconds")
    return times


def _worker(form: Form, network: str) -> Worker:
    policy = {"OMP_WAIT_POLICY": "PASSIVE"} if form.waiting == "sleep" else {}
    environment = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    with patch.dict(os.environ, environment | policy, clear=True):
        return Worker(Answers, form, network)


@contextmanager
def _busy_processes(count: int) -> Iterator[None]:
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def busy_table(rows: Sequence[Result]) -> Table:
    """Return one row per form; the ratio is within turns, because the speed of a machine drifts."""
    numbers = sorted({row["busy"] for row in rows})
    most = max(row["threads"] for row in rows)
    cells = []
    for form in dict.fromkeys((row["runtime"], row["threads"], row["waiting"]) for row in rows):
        cells.append([*map(str, form)])
        for busy in numbers:
            own, default = (
                _times(rows, chosen, busy) for chosen in (form, (rows[0]["runtime"], most, "sleep"))
            )
            summary = summarize_ms(own)
            cells[-1] += [
                f"{format_ms(summary['median_ms'])} ({format_ms(summary['p90_ms'])})",
                f"{np.median(np.divide(own, default)):.2f}",
            ]
    columns = ["runtime", "threads", "waiting threads"]
    for busy in numbers:
        columns += [f"busy: {busy}", "×"]
    return Table(
        "An answer on busy processors", tuple(columns), tuple(map(tuple, cells)), _NOTE, text_columns=3
    )


def _times(rows: Sequence[Result], form: tuple[str, int, str], busy: int) -> list[float]:
    (times,) = (
        row["milliseconds"]
        for row in rows
        if (row["runtime"], row["threads"], row["waiting"], row["busy"]) == (*form, busy)
    )
    return list(times)
