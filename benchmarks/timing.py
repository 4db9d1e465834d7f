# SPDX-License-Identifier: Apache-2.0
"""How long a step takes, how much memory it needs, and how quick this machine's matrix product is."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import torch

_ENOUGH_S = 1.0
_ENOUGH_STEPS = 3
_MATRIX_SIZE = 2048
_PRODUCTS = 4


def step_s(step: Callable[[], object], warm_up: bool = True) -> float:
    """Median seconds of a step: three steps, or as many as begin within a second, after one that does not count."""
    if warm_up:
        step()
    seconds: list[float] = []
    while len(seconds) < _ENOUGH_STEPS and sum(seconds) < _ENOUGH_S:
        started = time.perf_counter()
        step()
        seconds.append(time.perf_counter() - started)
    return median(seconds)


class MatrixPeak:
    """The quickest of a few products of two 2048 x 2048 matrices, made in a process of its own."""

    def __init__(self, threads: int) -> None:
        torch.set_num_threads(threads)
        self._matrix = torch.randn(_MATRIX_SIZE, _MATRIX_SIZE, generator=torch.Generator().manual_seed(0))

    def gflops(self, bf16: bool) -> float:
        """GFLOP/s, a multiplication and an addition being two operations."""
        matrix = self._matrix.bfloat16() if bf16 else self._matrix
        matrix @ matrix
        seconds: list[float] = []
        for _ in range(_PRODUCTS):
            started = time.perf_counter()
            matrix @ matrix
            seconds.append(time.perf_counter() - started)
        return 2 * _MATRIX_SIZE**3 / min(seconds) / 1e9


def resident_mib(process: int | str = "self") -> float:
    """Memory a process occupies now, this one if not given; NaN where /proc does not tell."""
    return _status_mib("VmRSS", process)


def peak_resident_mib() -> float:
    """The most it occupied since the last `reset_peak`."""
    return _status_mib("VmHWM")


def reset_peak() -> None:
    """Begin a new peak, from what is occupied now (proc(5), clear_refs)."""
    clear = Path("/proc/self/clear_refs")
    if clear.exists():
        clear.write_text("5")


def _status_mib(field: str, process: int | str = "self") -> float:
    status = Path(f"/proc/{process}/status")
    lines = status.read_text(encoding="utf-8").splitlines() if status.exists() else []
    kib = [int(line.split()[1]) for line in lines if line.startswith(field + ":")]
    return kib[0] / 1024 if kib else float("nan")
