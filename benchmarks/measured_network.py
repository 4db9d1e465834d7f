# SPDX-License-Identifier: Apache-2.0
"""One network in one form, measured in a worker: training, inference, memory, operators."""

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
from benchmarks.forms import PORT_OPTIONS, Form, build_form, plain_form
from benchmarks.timing import median_seconds, peak_resident_mib, reset_peak, resident_mib
from doorstate._memory import keep_freed_memory
from doorstate.networks import create_network

_LONG_STEP_S = 1.0
_SEED = 0


class NetworkTask(NamedTuple):
    """Everything that a worker needs; the clouds are normalised."""

    network: str
    form: Form
    clouds: Clouds
    batch: int
    threads: int
    checkout: Path | None = None  # of a port
    same_allocator: bool = False
    device: str = "cpu"


class MeasuredNetwork:
    """One network in one form."""

    def __init__(self, task: NetworkTask) -> None:
        torch.set_num_threads(task.threads)
        if task.form.kind == "fast" or task.same_allocator:
            keep_freed_memory()
        torch.manual_seed(_SEED)
        self._device = task.device
        self._clouds = torch.from_numpy(task.clouds.points).to(task.device)
        self._points = self._clouds[: task.batch]
        self._labels = torch.from_numpy(task.clouds.labels[: task.batch]).to(task.device)
        self._bf16 = task.form.bf16
        self._module = build_form(task.form, task.network, task.checkout, self._points).to(task.device)
        self._optimizer = torch.optim.AdamW(self._module.parameters(), 1e-3, weight_decay=0.05)
        self._last_s: dict[str, float] = {}
        self._memory_mib: float | None = None

    def training_seconds(self) -> float:
        """Measure a training step: loss, gradients, AdamW."""
        self._module.train()
        before = self._memory()
        self._reset_peak()
        seconds = self._measure("training", self.train_step)
        if self._memory_mib is None:
            self._memory_mib = self._peak_memory() - before
        return seconds

    def memory_mib(self) -> float:
        """Return the highest growth of memory in the first training steps of this process."""
        return float("nan") if self._memory_mib is None else self._memory_mib

    def inference_seconds(self, batch: int) -> float:
        """Measure the classification of a batch."""
        self._module.eval()
        return self._measure(f"inference {batch}", lambda: self.infer(batch))

    def threads(self) -> int:
        """Return the number of threads of torch in this process."""
        return torch.get_num_threads()

    def train_step(self) -> None:
        """Run one training step."""
        self._optimizer.zero_grad(set_to_none=True)
        with self._autocast():
            loss: Tensor = self._module.training_loss(self._points, self._labels)[0]  # type: ignore[operator]
        loss.backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()

    def infer(self, batch: int) -> None:
        """Compute the logits of a batch."""
        with torch.inference_mode(), self._autocast():
            self._module(self._clouds[:batch])

    def profile(self, training: bool, steps: int = 2) -> list[tuple[str, float]]:
        """Return operators with their own milliseconds per step, longest first."""
        self._module.train(training)
        step = self.train_step if training else lambda: self.infer(1)
        step()
        with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CPU]) as profiler:
            for _ in range(steps):
                step()
        events = profiler.key_averages()
        operators = [(event.key, event.self_cpu_time_total / 1000 / steps) for event in events]
        return sorted(operators, key=lambda operator: -operator[1])

    def _measure(self, name: str, step: Callable[[], object]) -> float:
        # A step of several seconds needs no warm-up after the first round.
        seconds = median_seconds(
            step, warm_up=self._last_s.get(name, 0.0) < _LONG_STEP_S, device=self._device
        )
        self._last_s[name] = seconds
        return seconds

    def _autocast(self) -> AbstractContextManager[object]:
        return torch.autocast(torch.device(self._device).type, torch.bfloat16, enabled=self._bf16)

    def _memory(self) -> float:
        return resident_mib() if self._device == "cpu" else torch.cuda.memory_allocated(self._device) / 2**20

    def _peak_memory(self) -> float:
        if self._device == "cpu":
            return peak_resident_mib()
        return torch.cuda.max_memory_allocated(self._device) / 2**20

    def _reset_peak(self) -> None:
        if self._device == "cpu":
            reset_peak()
        else:
            torch.cuda.reset_peak_memory_stats(self._device)


class OperationCount:
    """Number of operations of a network's plain form."""

    def __init__(self, network: str, clouds: Clouds) -> None:
        self._form = plain_form(create_network(network, **PORT_OPTIONS.get(network, {})).eval())
        self._points = torch.from_numpy(clouds.points[:1])

    def training_gflop(self) -> float:
        """Return GFLOP of a training step on one cloud.

        A multiply-add counts as 2 operations, and the backward pass as twice the forward pass.
        """
        with _Products() as products:
            self._form(self._points)
        return float(3 * products.operations / 1e9)


class _Products(TorchDispatchMode):  # type: ignore[no-untyped-call]
    """Counter of the operations of products with gradients, which leaves out the search for neighbours."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.operations = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):  # type: ignore[no-untyped-def]
        out = func(*args, **(kwargs or {}))
        count = flop_registry.get(func.overloadpacket)
        if count is not None and torch.is_grad_enabled():
            self.operations += count(*args, **(kwargs or {}), out_val=out)
        return out
