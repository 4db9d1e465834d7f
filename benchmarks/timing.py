# SPDX-License-Identifier: Apache-2.0
"""Durations, memory and matrix speed: every benchmark measures with these functions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
import torch

_MIN_DURATION_S = 1.0
_MAX_STEPS, _MAX_STEPS_ON_DEVICE = 3, 10
_MATRIX_SIZE, _MATRIX_SIZE_ON_DEVICE = 2048, 8192
_PRODUCTS = 4


def median_seconds(step: Callable[[], object], warm_up: bool = True, device: str = "cpu") -> float:
    """Return the median duration of a step.

    Args:
        step: run three times, or until one second has passed; ten times on a CUDA device.
        warm_up: run it once before, without measuring.
        device: what the step waits for.
    """
    if warm_up:
        step()
    finish(device)
    seconds: list[float] = []
    most_steps = _MAX_STEPS if device == "cpu" else _MAX_STEPS_ON_DEVICE
    while len(seconds) < most_steps and sum(seconds) < _MIN_DURATION_S:
        started = time.perf_counter()
        step()
        finish(device)
        seconds.append(time.perf_counter() - started)
    return median(seconds)


def finish(device: str) -> None:
    """Wait for the work of a device."""
    if device != "cpu":
        torch.cuda.synchronize(device)


@contextmanager
def timed_calls(owner: object, name: str) -> Iterator[list[float]]:
    """Yield a list that receives the milliseconds of every call of one function through a module or class."""
    function, durations_ms = getattr(owner, name), []

    def timed(*arguments: Any, **options: Any) -> Any:
        started = time.perf_counter()
        result = function(*arguments, **options)
        durations_ms.append((time.perf_counter() - started) * 1000)
        return result

    with patch.object(owner, name, timed):
        yield durations_ms


def summarize_ms(durations_ms: Sequence[float]) -> dict[str, float]:
    """Return median, 90th percentile and maximum of durations in milliseconds."""
    return {
        "median_ms": float(np.median(durations_ms)),
        "p90_ms": float(np.percentile(durations_ms, 90)),
        "max_ms": max(durations_ms),
    }


def format_ms(value: float) -> str:
    """Format milliseconds with three digits, and at most two decimals."""
    return f"{value:.{2 if value < 10 else 1 if value < 100 else 0}f}"


class MatrixSpeed:
    """Speed of products of two square matrices, of 2048 rows, or 8192 on a CUDA device, in a process of its own."""

    def __init__(self, threads: int, device: str = "cpu") -> None:
        torch.set_num_threads(threads)
        self._device, self._size = device, _MATRIX_SIZE if device == "cpu" else _MATRIX_SIZE_ON_DEVICE
        matrix = torch.randn(self._size, self._size, generator=torch.Generator().manual_seed(0))
        self._matrix = matrix.to(device)

    def gflops(self, bf16: bool) -> float:
        """Return the highest of a few measurements in GFLOP/s; a multiply-add counts as two operations."""
        matrix = self._matrix.bfloat16() if bf16 else self._matrix
        matrix @ matrix
        finish(self._device)
        seconds: list[float] = []
        for _ in range(_PRODUCTS):
            started = time.perf_counter()
            matrix @ matrix
            finish(self._device)
            seconds.append(time.perf_counter() - started)
        return 2 * self._size**3 / min(seconds) / 1e9


def resident_mib(process: int | str = "self") -> float:
    """Return the memory of a process, by default of this one; NaN where /proc has no such value."""
    return _status_mib("VmRSS", process)


def process_tree(process: int) -> list[int]:
    """Return the numbers of a process and of all its children."""
    try:
        children = Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii").split()
    except OSError:
        return [process]
    return [process, *(number for child in children for number in process_tree(int(child)))]


def tree_resident_mib(process: int) -> float:
    """Return the memory of a process and its children; pages that they share count in each."""
    return sum(map(resident_mib, process_tree(process)))


def tree_shared_once_mib(process: int) -> float:
    """Return the memory of a process and its children; pages that they share count once (PSS, proc(5))."""
    return sum(_status_mib("Pss", number, "smaps_rollup") for number in process_tree(process))


def peak_resident_mib() -> float:
    """Return the highest memory of this process since the last `reset_peak`."""
    return _status_mib("VmHWM", "self")


def reset_peak() -> None:
    """Set the highest memory to the current one (proc(5), clear_refs)."""
    clear_refs = Path("/proc/self/clear_refs")
    if clear_refs.exists():
        clear_refs.write_text("5")


def _status_mib(field: str, process: int | str, file: str = "status") -> float:
    status = Path(f"/proc/{process}/{file}")
    try:
        lines = status.read_text(encoding="utf-8").splitlines()
    except OSError:  # the process ended, or there is no /proc
        lines = []
    kib = [int(line.split()[1]) for line in lines if line.startswith(field + ":")]
    return kib[0] / 1024 if kib else float("nan")
