# SPDX-License-Identifier: Apache-2.0
"""Bad input by the thousand, through every door of the package: it may be refused, and nothing else may happen."""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from benchmarks.fuzzer import FAILURES, LIMIT_MIB, LIMIT_S, OUTCOMES, TARGETS, Fuzzer
from benchmarks.store import Group
from benchmarks.workers import Worker
from doorstate._files import atomic_path
from doorstate._jobs import Progress
from doorstate.clouds.preparation import MIN_POINTS
from doorstate.errors import RunError
from doorstate.evaluation.table import Table


def measure(
    first: int, inputs: int, seconds: float | None, workers: int, folder: Path, progress: Progress
) -> list[Group]:
    """Try inputs with the numbers from `first` on, and count what becomes of them, by target.

    Args:
        first: number of the first input; the same numbers are the same inputs.
        inputs: how many.
        seconds: stop after so many, if not all are tried before.
        workers: processes.
        folder: where inputs that made something fail are kept.
    """
    until = time.monotonic() + (float("inf") if seconds is None else seconds)
    tried = Counter[tuple[str, str]]()
    failures: list[Group] = []

    def run(worker: int) -> None:
        fuzzer = Worker(Fuzzer, Path(scratch))
        for number in range(first + worker, first + inputs, workers):
            if time.monotonic() > until:
                break
            try:
                target, outcome, detail = fuzzer.call("attempt", number)
            except RunError as error:  # the process died
                fuzzer = Worker(Fuzzer, Path(scratch))
                target, outcome, detail = fuzzer.call("draw", number)[0], "crash", str(error)
            tried[target, outcome] += 1
            progress(sum(tried.values()), inputs)
            if outcome in FAILURES:
                failures.append({"number": number, "target": target, "outcome": outcome, "detail": detail})
                _keep(folder, number, *fuzzer.call("draw", number))
            if outcome == "memory":  # a peak would hide the next one
                fuzzer.close()
                fuzzer = Worker(Fuzzer, Path(scratch))
        fuzzer.close()

    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(workers) as threads:
        list(threads.map(run, range(workers)))
    return [
        {"target": target}
        | {outcome: tried[target, outcome] for outcome in OUTCOMES}
        | {"failures": sorted((f for f in failures if f["target"] == target), key=lambda f: int(f["number"]))}
        for target in TARGETS
    ]


def fuzz_table(rows: Sequence[Group], first: int) -> Table:
    """A line for every target and one for all, and below them what failed."""
    lines = [[row["target"], *(row[outcome] for outcome in OUTCOMES)] for row in rows]
    lines.append(["all", *(sum(row[outcome] for row in rows) for outcome in OUTCOMES)])
    cells = [(line[0], f"{sum(line[1:]):,}", *(f"{count:,}" for count in line[1:])) for line in lines]
    note = (
        f"Inputs from number {first} on. *Answered*: a state, of a camera file through its camera; *no state*: none, "
        "with the reason; *refused*: an error of one line; *crash*: anything else that is raised or warned of; *hang*: "
        f"more than {LIMIT_S:g} s of processor time; *memory*: more than {LIMIT_MIB} MiB; *answer without data*: a "
        f"state from fewer than {MIN_POINTS} measured points, without the gate."
    )
    failed = [
        f"{f['target']} {f['number']}: {f['outcome']}, {f['detail']}" for row in rows for f in row["failures"]
    ]
    return Table("Bad input", ("input", "tried", *OUTCOMES), tuple(cells), "\n\n".join([note, *failed]))


def _keep(folder: Path, number: int, target: str, given: Any) -> None:
    """A file as it is, a message as text."""
    is_file = isinstance(given, tuple)
    suffix, content = given if is_file else (".json", json.dumps(given, default=_text, indent=1).encode())
    with atomic_path(folder / f"{number}-{target.strip('.').replace(' ', '-')}{suffix}") as temporary:
        temporary.write_bytes(content)


def _text(value: Any) -> Any:
    """A message by its fields, and what they hold that JSON does not."""
    return vars(value) if isinstance(value, SimpleNamespace) else repr(value)
