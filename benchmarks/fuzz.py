# SPDX-License-Identifier: Apache-2.0
"""Bad input by the thousand, through every door of the package: it may be refused, and nothing else may happen."""

from __future__ import annotations

import asyncio
import faulthandler
import json
import os
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from benchmarks.clouds import raw_cloud
from benchmarks.mutations import (
    bomb,
    draw_cloud_message,
    draw_compressed_message,
    draw_file,
    draw_image_message,
    draw_number,
)
from benchmarks.store import Group
from benchmarks.workers import Worker
from doorstate.clouds.camera import Pinhole
from doorstate.clouds.declared import MAX_POINTS
from doorstate.clouds.depth_messages import pixels_from_compressed_depth, pixels_from_image
from doorstate.clouds.io import (
    CLOUD_SUFFIXES,
    ReadOptions,
    parse_cloud,
    points_from_depth,
    points_in_body,
    read_cloud,
)
from doorstate.clouds.pointcloud2 import points_from_pointcloud2
from doorstate.clouds.preparation import MIN_POINTS
from doorstate.deployment.predictor import Prediction, Predictor
from doorstate.deployment.service import create_app
from doorstate.deployment.workload import Limits
from doorstate.errors import CameraError, CloudError, DoorstateError, RunError
from doorstate.evaluation.table import Table
from doorstate.files import atomic_path
from doorstate.jobs import Progress
from doorstate.types import Points

LIMIT_S = 1.0  # of processor time for one input
LIMIT_MIB = 1536  # that one input may take beyond what the process had
_DEADLOCK_S = 20.0  # by the clock, however busy the machine
_BOMB_POINTS = (2**20, MAX_POINTS + 4096, 40 * 10**6)
_BOMBS = 0.002  # share of files that unpack to far more than they hold
OUTCOMES = ("answered", "no state", "refused", "crash", "hang", "memory", "answer without data")
FAILURES = OUTCOMES[3:]
MESSAGES = ("PointCloud2", "Image", "CompressedImage")
TARGETS = (*CLOUD_SUFFIXES, "file name", *MESSAGES, "service")
_CAMERA = Pinhole(69.28, 69.28, 39.94, 29.94)  # of the scene: every eighth pixel of 640 x 480, 60 degrees
_STATUSES = {200, 400, 404, 405, 413, 415, 422}  # that one client at a time may get


class Fuzzer:
    """Everything that reads, in one process; an input is made from its number alone."""

    def __init__(self, scratch: Path) -> None:
        warnings.simplefilter("error")  # of what is no error a user sees nothing
        self._scene = np.ascontiguousarray(raw_cloud()[::8, ::8])
        self._predict = Predictor.load("pointnet2", MIN_POINTS, gate=None)
        self._gated = Predictor(self._predict.network, self._predict.card, MIN_POINTS)
        self._app = create_app(self._gated, Limits(max_bytes=2**20, queue=1, workers=1))
        self._runner = asyncio.Runner()
        self._folder = scratch / str(os.getpid())
        self._folder.mkdir()
        self._gated.warm_up()
        self._most_mib = _peak_mib() + LIMIT_MIB

    def attempt(self, number: int) -> tuple[str, str, str]:
        """Target, outcome, and what was wrong of the input with this number."""
        target, given = self.draw(number)
        rng = np.random.default_rng((number, 1))
        faulthandler.dump_traceback_later(_DEADLOCK_S, exit=True)
        started = time.process_time()
        try:
            outcome, detail = self._attempt(rng, target, given)
        except DoorstateError as error:
            outcome, detail = _judge_error(error)
        except Exception as error:
            outcome, detail = "crash", f"{type(error).__name__}: {error}"
        finally:
            faulthandler.cancel_dump_traceback_later()
        spent_s = time.process_time() - started
        if outcome not in FAILURES and spent_s > LIMIT_S:
            outcome, detail = "hang", f"{spent_s:.1f} s of processor time"
        if outcome not in FAILURES and _peak_mib() > self._most_mib:
            outcome, detail = "memory", f"{_peak_mib() - self._most_mib + LIMIT_MIB:.0f} MiB more"
        return target, outcome, " ".join(detail.split())[:300]

    def draw(self, number: int) -> tuple[str, Any]:
        """Target and input of a number: arguments of a message's reader, or a suffix and what a file holds."""
        rng = np.random.default_rng(number)
        target = str(rng.choice(TARGETS))
        return target, self._draw(rng, target)

    def _draw(self, rng: np.random.Generator, target: str) -> Any:
        match target:
            case "PointCloud2":
                return draw_cloud_message(rng, self._scene)
            case "Image":
                return draw_image_message(rng, self._scene)
            case "CompressedImage":
                return draw_compressed_message(rng, self._scene)
        suffix = target if target in CLOUD_SUFFIXES else str(rng.choice(CLOUD_SUFFIXES))
        if rng.random() < _BOMBS:
            return suffix, bomb(suffix, int(rng.choice(_BOMB_POINTS)))
        return suffix, draw_file(rng, suffix, self._scene)

    def _attempt(self, rng: np.random.Generator, target: str, given: Any) -> tuple[str, str]:
        if target == "service":
            return self._runner.run(self._post(rng, *given))
        options = _draw_options(rng)
        if target in MESSAGES:
            points = _points_of_message(target, given, options)
        elif target == "file name":
            points = self._read(rng, given[0], given[1], options)
        else:
            points = parse_cloud(given[1], given[0], options)
        return self._judge(points)

    def _judge(self, points: Points) -> tuple[str, str]:
        """With the gate and without it."""
        measured = points.reshape(-1, 3)[
            np.isfinite(points).all(axis=-1).ravel() & points.any(axis=-1).ravel()
        ]
        answers: list[Prediction] = [self._predict(points), self._gated(points)]
        if len(np.unique(measured[: 2 * MIN_POINTS], axis=0)) < MIN_POINTS and len(measured) < 2 * MIN_POINTS:
            return "answer without data", f"{answers[0].state!r} of {len(measured)} points"
        if not np.isfinite(list(answers[0].probabilities.values())).all():
            return "crash", f"probabilities {answers[0].probabilities}"
        return ("no state" if answers[1].state is None else "answered"), ""

    def _read(self, rng: np.random.Generator, suffix: str, data: bytes, options: ReadOptions) -> Points:
        """From a file whose name may be no text."""
        stem = [b"cloud", b"\xff\xfe", "é".encode(), b"a b\tc", b"-", b"%s{}"][rng.integers(6)]
        path = self._folder / (stem.decode(errors="surrogateescape") + suffix)
        path.write_bytes(data)
        try:
            return read_cloud(path, options)
        finally:
            path.unlink()

    async def _post(self, rng: np.random.Generator, suffix: str, data: bytes) -> tuple[str, str]:
        query = {"format": suffix, "frame": "optical"} if rng.random() < 0.5 else {"filename": f"a{suffix}"}
        if rng.random() < 0.7:
            query |= {name: str(value) for name, value in _CAMERA._asdict().items()}
        if rng.random() < 0.3:
            values = ["", "nan", "-1", "mm", "1e999", "\x00", "\ufffd", str(draw_number(rng))]
            query[str(rng.choice(["format", "frame", "roll", "units", "depth_scale", "fx", "x"]))] = str(
                rng.choice(values)
            )
        async with httpx.AsyncClient(
            transport=httpx.ASGITransport(self._app), base_url="http://here"
        ) as client:
            response = await client.post("/predict", params=query, content=data)
        content = response.json()
        if response.status_code not in _STATUSES:
            return "crash", f"status {response.status_code}: {content}"
        if response.status_code != 200:
            return _judge_line(content["error"])
        return ("no state" if content["state"] is None else "answered"), ""


def _draw_options(rng: np.random.Generator) -> ReadOptions:
    return ReadOptions(
        frame="optical" if rng.random() < 0.2 else "body",
        roll_deg=int(rng.choice([0, 90, 180, 270])) if rng.random() < 0.2 else 0,
        intrinsics=_CAMERA if rng.random() < 0.8 else None,
        units_m=0.001 if rng.random() < 0.1 else 1.0,
    )


def _points_of_message(target: str, message: dict[str, Any], options: ReadOptions) -> Points:
    if target == "PointCloud2":
        return points_in_body(points_from_pointcloud2(**message), options)
    readers: dict[str, Callable[..., Any]] = {
        "Image": pixels_from_image,
        "CompressedImage": pixels_from_compressed_depth,
    }
    return points_from_depth(readers[target](**message), options)


def _judge_error(error: DoorstateError) -> tuple[str, str]:
    if not isinstance(error, CloudError | CameraError):
        return "crash", f"{type(error).__name__}: {error}"
    return _judge_line(str(error))


def _judge_line(line: str) -> tuple[str, str]:
    """A refusal is one line that can be printed."""
    if len(line.splitlines()) != 1 or len(line) > 1000:
        return "crash", f"no line: {line!r}"
    return "refused", ""


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 1024)


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
        f"Inputs from number {first} on. *No state*: refused by the gate; *refused*: an error of one line; *crash*: "
        f"anything else that is raised or warned of; *hang*: more than {LIMIT_S:g} s of processor time; *memory*: "
        f"more than {LIMIT_MIB} MiB; *answer without data*: a state from fewer than {MIN_POINTS} measured points, "
        "without the gate."
    )
    failed = [
        f"{f['target']} {f['number']}: {f['outcome']}, {f['detail']}" for row in rows for f in row["failures"]
    ]
    return Table("Bad input", ("input", "tried", *OUTCOMES), tuple(cells), "\n\n".join([note, *failed]))


def _keep(folder: Path, number: int, target: str, given: Any) -> None:
    """A file as it is, a message as text."""
    is_file = isinstance(given, tuple)
    suffix, content = given if is_file else (".json", json.dumps(given, default=repr, indent=1).encode())
    with atomic_path(folder / f"{number}-{target.strip('.').replace(' ', '-')}{suffix}") as temporary:
        temporary.write_bytes(content)
