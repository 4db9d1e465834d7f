# SPDX-License-Identifier: Apache-2.0
"""What lives in a worker: one network in one form, trained, asked and profiled on one batch."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils.flop_counter import flop_registry

from benchmarks.clouds import Clouds
from benchmarks.forms import AS_PORTS, Form, build_form, plain_form
from benchmarks.timing import peak_resident_mib, reset_peak, resident_mib, step_s
from doorstate._memory import keep_freed_memory
from doorstate.networks import create_network

_SLOW_S = 1.0
_SEED = 0


class Task(NamedTuple):
    """Everything a worker needs to know; `clouds` are normalised."""

    network: str
    form: Form
    clouds: Clouds
    batch: int
    threads: int
    checkout: Path | None = None
    same_allocator: bool = False


class Subject:
    """One network in one form."""

    def __init__(self, task: Task) -> None:
        torch.set_num_threads(task.threads)
        if task.form.kind == "fast" or task.same_allocator:
            keep_freed_memory()
        torch.manual_seed(_SEED)
        self._clouds = torch.from_numpy(task.clouds.points)
        self._points = self._clouds[: task.batch]
        self._labels = torch.from_numpy(task.clouds.labels[: task.batch])
        self._bf16 = task.form.bf16
        self._module = build_form(task.form, task.network, task.checkout, self._points)
        self._optimizer = torch.optim.AdamW(self._module.parameters(), 1e-3, weight_decay=0.05)
        self._last_s: dict[str, float] = {}
        self._memory_mib: float | None = None

    def train_s(self) -> float:
        """Seconds of a training step: loss, gradients, AdamW."""
        self._module.train()
        before = resident_mib()
        reset_peak()
        seconds = self._sample("train", self.training_step)
        if self._memory_mib is None:
            self._memory_mib = peak_resident_mib() - before
        return seconds

    def memory_mib(self) -> float:
        """How far memory grew in the first training steps of this process, at its highest."""
        return float("nan") if self._memory_mib is None else self._memory_mib

    def infer_s(self, batch: int) -> float:
        """Seconds to classify so many clouds together."""
        self._module.eval()
        return self._sample(f"infer {batch}", lambda: self.inference(batch))

    def threads(self) -> int:
        """Threads torch uses in here."""
        return torch.get_num_threads()

    def training_step(self) -> None:
        """One step on the batch."""
        self._optimizer.zero_grad(set_to_none=True)
        with self._autocast():
            loss: Tensor = self._module.training_loss(self._points, self._labels)[0]  # type: ignore[operator]
        loss.backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()

    def inference(self, batch: int) -> None:
        """Logits of the first clouds."""
        with torch.inference_mode(), self._autocast():
            self._module(self._clouds[:batch])

    def profile(self, training: bool, steps: int = 2) -> list[tuple[str, float]]:
        """Operators and the milliseconds per step they spent themselves, the longest first."""
        self._module.train(training)
        step = self.training_step if training else lambda: self.inference(1)
        step()
        with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CPU]) as profiler:
            for _ in range(steps):
                step()
        found = [(event.key, event.self_cpu_time_total / 1000 / steps) for event in profiler.key_averages()]
        return sorted(found, key=lambda item: -item[1])

    def _sample(self, name: str, step: Callable[[], object]) -> float:
        # A step of many seconds is not warmer for another one before it.
        seconds = step_s(step, warm_up=self._last_s.get(name, 0.0) < _SLOW_S)
        self._last_s[name] = seconds
        return seconds

    def _autocast(self) -> AbstractContextManager[object]:
        return torch.autocast("cpu", torch.bfloat16, enabled=self._bf16)


class OperationCount:
    """Operations of the plain form's products on one cloud."""

    def __init__(self, network: str, clouds: Clouds) -> None:
        self._form = plain_form(create_network(network, **AS_PORTS.get(network, {})).eval())
        self._points = torch.from_numpy(clouds.points[:1])

    def training_gflop(self) -> float:
        """2 operations per multiply-add of the forward pass, times 3: backward takes twice as many."""
        with _Products() as products:
            self._form(self._points)
        return float(3 * products.operations / 1e9)


class _Products(TorchDispatchMode):  # type: ignore[no-untyped-call]
    """Counts operations of products that a gradient may flow through, so not those of neighbour search."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.operations = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):  # type: ignore[no-untyped-def]
        out = func(*args, **(kwargs or {}))
        count = flop_registry.get(func.overloadpacket)
        if count is not None and torch.is_grad_enabled():
            self.operations += count(*args, **(kwargs or {}), out_val=out)
        return out
