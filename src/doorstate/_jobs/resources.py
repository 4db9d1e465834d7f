# SPDX-License-Identifier: Apache-2.0
"""Resources of a piece: what it asks for, and how many such pieces fit into this machine."""

from __future__ import annotations

import os
from dataclasses import dataclass

from doorstate.errors import ConfigError


@dataclass(frozen=True)
class Resources:
    """Processors, GPUs and memory that one piece occupies while it runs.

    Args:
        cpus: processors, which is also the number of its threads.
        gpus: GPUs; a fraction shares one.
        memory_bytes: main memory; 0 is not counted.

    Raises:
        ConfigError: a number is not possible.
    """

    cpus: int = 1
    gpus: float = 0.0
    memory_bytes: int = 0

    def __post_init__(self) -> None:
        if self.cpus < 1:
            raise ConfigError(f"{self.cpus} is not possible", field="cpus", expected="1 or more")
        if self.gpus < 0 or (self.gpus > 1 and self.gpus != int(self.gpus)):
            raise ConfigError(
                f"{self.gpus:g} is not possible", field="gpus", expected="0, a fraction of one, or whole ones"
            )
        if self.memory_bytes < 0:
            raise ConfigError(
                f"{self.memory_bytes} is not possible", field="memory_bytes", expected="0 or more"
            )

    def __str__(self) -> str:
        parts = [f"{self.cpus} processors"]
        parts += [f"{self.gpus:g} GPUs"] if self.gpus else []
        parts += [f"{self.memory_bytes / 2**30:.3g} GiB of memory"] if self.memory_bytes else []
        return ", ".join(parts)

    def times_in(self, cpus: float, gpus: float, memory_bytes: float) -> int:
        """Return the number of such pieces that a machine with these resources holds at the same time."""
        # One piece does not spread over GPUs that it has only shares of.
        by_gpu = 1 / self.gpus if 0 < self.gpus <= 1 else 1.0
        counts = [int(cpus // self.cpus)]
        if self.gpus:
            counts.append(int(gpus) * int(by_gpu + 1e-9) if self.gpus <= 1 else int(gpus // self.gpus))
        if self.memory_bytes:
            counts.append(int(memory_bytes // self.memory_bytes))
        return min(counts)


def default_workers() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def visible_gpus() -> list[str]:
    """Return the names of the GPUs that this process may use, as `CUDA_VISIBLE_DEVICES` spells them."""
    if (listed := os.environ.get("CUDA_VISIBLE_DEVICES")) is not None:
        return [name.strip() for name in listed.split(",") if name.strip() not in ("", "-1")]
    try:
        import torch
    except ModuleNotFoundError:
        return []
    return [str(number) for number in range(torch.cuda.device_count())]


def memory_bytes() -> int:
    """Return the main memory of this machine; where it cannot be told, more than any piece asks for."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # Windows
        return 2**62


def pieces_on_this_machine(resources: Resources) -> int:
    """Return the number of pieces that this machine holds at the same time.

    Raises:
        ConfigError: not even one.
    """
    gpus = visible_gpus() if resources.gpus else []
    count = resources.times_in(default_workers(), len(gpus), memory_bytes())
    if not count:
        have = Resources(default_workers(), len(gpus), memory_bytes() if resources.memory_bytes else 0)
        raise ConfigError(f"this machine does not have {resources}", expected=f"at most {have}")
    return count
