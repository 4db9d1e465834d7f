# SPDX-License-Identifier: Apache-2.0
"""State of an unfinished training, saved so that a killed run continues exactly where it stopped."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import torch
from pydantic import BaseModel, FiniteFloat
from torch import Tensor, nn
from torch.optim import Optimizer

from doorstate._files import atomic_path
from doorstate.errors import RunError, summarize_exception
from doorstate.training.schedules import RateSchedule


class EpochProgress(NamedTuple):
    """Part of an epoch that is done."""

    losses: list[float]  # of each iteration
    rate: float  # learning rate of the last iteration
    generator: Tensor  # state of torch's generator
    seconds: float


@dataclass
class TrainingState:
    """Everything that changes during a training, except weights, optimizers and schedule."""

    log: list[dict[str, float]] = field(default_factory=list)  # one entry per finished epoch
    best_score: tuple[float, float] = (-1.0, -math.inf)
    best_epoch: int = -1
    progress: EpochProgress | None = None  # of the epoch after the log


class Checkpoint(NamedTuple):
    """File of a training's state, and the objects whose state is in it."""

    path: Path
    network: nn.Module
    optimizers: Sequence[Optimizer]
    schedule: RateSchedule

    def save(self, state: TrainingState) -> None:
        """Write the file in one step.

        Raises:
            OutputError: it cannot be written.
        """
        content = {
            "network": self.network.state_dict(),
            "optimizers": [optimizer.state_dict() for optimizer in self.optimizers],
            "schedule": self.schedule.state_dict(),
            "log": state.log,
            "best_score": list(state.best_score),
            "best_epoch": state.best_epoch,
            "progress": None if state.progress is None else list(state.progress),
        }
        # torch's own writer reports a full disk as an assertion of its C++ code.
        buffer = io.BytesIO()
        torch.save(content, buffer)
        with atomic_path(self.path) as temporary:
            temporary.write_bytes(buffer.getbuffer())

    def load(self) -> TrainingState:
        """Restore all objects and return the state; a new one if there is no file. Nothing is unpickled.

        Raises:
            RunError: the file is damaged, or was edited.
        """
        if not self.path.is_file():
            return TrainingState()
        try:
            content = torch.load(self.path, map_location="cpu", weights_only=True)
            saved = _Saved.model_validate({name: content[name] for name in _Saved.model_fields})
            self.network.load_state_dict(content["network"])
            for optimizer, optimizer_state in zip(self.optimizers, content["optimizers"], strict=True):
                optimizer.load_state_dict(optimizer_state)
                _check_optimizer(optimizer)
            self.schedule.load_state_dict(content["schedule"])
            _check_finite(self.network.state_dict().values())
            generator = None if saved.progress is None else _generator_state(content["progress"][2])
        except Exception as error:  # torch raises many kinds for a file that is damaged or was edited
            raise RunError(
                f"cannot be read ({summarize_exception(error)})",
                path=self.path,
                hint="delete the folder of the run",
            ) from error
        progress = None
        if saved.progress is not None and generator is not None:
            losses, rate, _, seconds = saved.progress
            progress = EpochProgress(losses, rate, generator, seconds)
        return TrainingState(saved.log, saved.best_score, saved.best_epoch, progress)


class _Saved(BaseModel):
    """Numbers of a checkpoint; the tensors are checked apart."""

    log: list[dict[str, float]]
    best_score: tuple[FiniteFloat, float]  # the second is -inf before the first epoch
    best_epoch: int
    progress: tuple[list[float], FiniteFloat, Any, FiniteFloat] | None


def _check_optimizer(optimizer: Optimizer) -> None:
    for parameter, values in optimizer.state.items():
        tensors = [value for value in values.values() if isinstance(value, Tensor)]
        if any(tensor.dim() and tensor.shape != parameter.shape for tensor in tensors):
            raise ValueError("the state of an optimizer has another shape than its parameter")
        _check_finite(tensors)


def _check_finite(tensors: Iterable[Tensor]) -> None:
    if not all(torch.isfinite(tensor).all() for tensor in tensors):
        raise ValueError("a tensor holds infinity or NaN")


def _generator_state(state: Tensor) -> Tensor:
    """Return the state of a generator after a generator took it."""
    torch.Generator().set_state(state)
    return state
