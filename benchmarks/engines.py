# SPDX-License-Identifier: Apache-2.0
"""Engines of jobs: time to start, overhead for pieces of a second, gain of a second worker, and very many pieces."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.store import Result
from benchmarks.timing import peak_resident_mib
from benchmarks.workers import Worker
from doorstate._jobs import Engine, ProcessEngine, Progress, RayEngine, piece_paths, run_pieces
from doorstate.evaluation.table import Table

ENGINES = ("processes", "ray")
_PIECE_S = 1.0
_NOTE = (
    "*Start*: until the first of two pieces runs. *Overhead*: pieces that sleep one second, on two workers, from the "
    "start of the first to the end of the last, beyond the sleep; × is the ratio of that time to that of processes in "
    "the same turn. *Share of linear*: time of `simulate` and `prepare` with one worker, over twice that with two; "
    "workers are started in that time, Ray is not. *A piece*: of pieces that only create their file, in one call on "
    "two workers, with the peak memory of the program."
)


class EngineBenchmark(NamedTuple):
    """Sizes of the measurements."""

    scenes: int  # simulated and prepared
    pieces: int  # that do nothing
    seconds: int  # pieces of a second for each worker
    repeats: int


def measure_engines(plan: EngineBenchmark, engines: Sequence[str], progress: Progress) -> list[Result]:
    """Return one row for each engine; engines take turns.

    Args:
        plan: sizes.
        engines: some of `ENGINES`, of which the first is what others are compared with.
        progress: called with finished and all turns.
    """
    turns = [(turn, engine) for turn in range(plan.repeats) for engine in engines]
    values: dict[str, dict[str, list[float]]] = {engine: {} for engine in engines}
    for done, (_, engine) in enumerate(turns):
        progress(done, len(turns))
        # A process of its own: Ray stays in memory, and peaks of memory are those of one engine.
        with Worker(EngineMeasurement, engine, is_parent=True) as worker:
            measured: dict[str, float] = worker.call("start")
            measured |= worker.call("seconds", plan.seconds)
            measured |= worker.call("scenes", plan.scenes)
            measured |= worker.call("pieces", plan.pieces)
        for name, value in measured.items():
            values[engine].setdefault(name, []).append(value)
    progress(len(turns), len(turns))
    rows: list[Result] = []
    for engine, lists in values.items():
        pairs = zip(lists["seconds_s"], values[engines[0]]["seconds_s"], strict=True)
        row: dict[str, Any] = {"engine": engine} | {name: median(numbers) for name, numbers in lists.items()}
        rows.append(row | {"ratio_to_first": median(own / other for own, other in pairs)})
    return rows


class EngineMeasurement:
    """Measurements of one engine, in a process of its own."""

    def __init__(self, name: str) -> None:
        self._name = name

    def start(self) -> dict[str, float]:
        """Return the seconds until a piece runs."""
        started = time.time()
        with self._engine(2) as engine, _pieces(2) as paths:
            run_pieces(_stamp, [0.5, 0.5], paths, engine)
            return {"start_s": min(_stamps(paths)[0]) - started}

    def seconds(self, count: int) -> dict[str, float]:
        """Return the time of pieces of a second, and the share of it that is no sleep."""
        with self._engine(2) as engine, _pieces(2 * count) as paths:
            run_pieces(_stamp, [_PIECE_S] * len(paths), paths, engine)
            begins, ends = _stamps(paths)
        seconds = max(ends) - min(begins)
        return {"seconds_s": seconds, "overhead": seconds / (count * _PIECE_S) - 1}

    def scenes(self, count: int) -> dict[str, float]:
        """Return the times of simulating and preparing scenes with one and two workers, and the gain over linear."""
        times = [self._simulate_and_prepare(count, workers) for workers in (1, 2)]
        return {"one_worker_s": times[0], "two_workers_s": times[1], "linear": times[0] / (2 * times[1])}

    def pieces(self, count: int) -> dict[str, float]:
        """Return the milliseconds a piece of pieces that do nothing, and the program's peak memory."""
        with self._engine(2) as engine, _pieces(count) as paths:
            started = time.perf_counter()
            run_pieces(_touch, range(count), paths, engine)
            seconds = time.perf_counter() - started
        return {"piece_ms": seconds / count * 1000, "peak_mib": peak_resident_mib()}

    def _simulate_and_prepare(self, count: int, workers: int) -> float:
        from doorstate.clouds.preparation import CloudSpec
        from doorstate.dataset.preparation import Preparation
        from doorstate.dataset.prepare import prepare_dataset
        from doorstate.simulation.settings import settings_for
        from doorstate.simulation.writer import simulate_dataset

        settings = settings_for("varied", 0, None, count, (), "none")
        with tempfile.TemporaryDirectory() as folder, self._engine(workers) as engine:
            simulated, prepared = Path(folder, "simulated"), Path(folder, "prepared")
            # The first piece of a worker pays for its imports, in both engines.
            started = time.perf_counter()
            simulate_dataset(simulated, settings, engine)
            prepare_dataset(Preparation(simulated, CloudSpec()), prepared, engine)
            return time.perf_counter() - started

    @contextmanager
    def _engine(self, workers: int) -> Iterator[Engine]:
        if self._name == "processes":
            yield ProcessEngine(workers)
            return
        with RayEngine("local", workers) as engine:
            yield engine


@contextmanager
def _pieces(count: int) -> Iterator[list[Path]]:
    with tempfile.TemporaryDirectory() as folder:
        yield piece_paths(Path(folder), count, ".txt")


def _stamp(seconds: float, path: Path) -> None:
    begin = time.time()
    time.sleep(seconds)
    path.write_text(f"{begin} {time.time()}", encoding="ascii")


def _stamps(paths: list[Path]) -> tuple[list[float], list[float]]:
    pairs = [tuple(map(float, path.read_text(encoding="ascii").split())) for path in paths]
    return [begin for begin, _ in pairs], [end for _, end in pairs]


def _touch(_: int, path: Path) -> None:
    path.touch()


def engines_table(rows: list[Result]) -> Table:
    """Return the table of `measure_engines`."""
    columns: dict[str, Callable[[Result], str]] = {
        "engine": lambda row: str(row["engine"]),
        "start, s": lambda row: f"{row['start_s']:.1f}",
        "overhead": lambda row: f"{row['overhead']:.1%}",
        "×": lambda row: f"{row['ratio_to_first']:.3f}",
        "one worker, s": lambda row: f"{row['one_worker_s']:.1f}",
        "two workers, s": lambda row: f"{row['two_workers_s']:.1f}",
        "share of linear": lambda row: f"{row['linear']:.2f}",
        "a piece, ms": lambda row: f"{row['piece_ms']:.3f}",
        "peak, MiB": lambda row: f"{row['peak_mib']:.0f}",
    }
    cells = tuple(tuple(cell(row) for cell in columns.values()) for row in rows)
    return Table("Engines of jobs", tuple(columns), cells, _NOTE)
