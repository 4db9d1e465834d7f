# SPDX-License-Identifier: Apache-2.0
"""Processor threads of one call to a network."""

from __future__ import annotations

import os

from doorstate._jobs import default_workers

# A network of a few GFLOP gains little from more, and a robot has other work (docs/benchmarks/busy.md).
_MOST_THREADS = 4


def default_threads() -> int:
    """Return OMP_NUM_THREADS of the environment, as torch does; else the number of processors, at most four."""
    value = os.environ.get("OMP_NUM_THREADS", "")
    return int(value) if value.isdecimal() and int(value) else min(default_workers(), _MOST_THREADS)


def configure_torch(threads: int | None, *, used: bool) -> None:
    """Let waiting threads of torch sleep, and set their number, for the whole process.

    For programs, before torch is imported: the library itself changes no such setting. OMP_WAIT_POLICY stays if it is
    set.

    Args:
        threads: number of threads; None: `default_threads()`.
        used: torch will run the network; if it will not, it is not imported.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    if not used:
        return
    try:
        import torch
    except ImportError:  # loading the network reports it
        return
    torch.set_num_threads(threads or default_threads())
