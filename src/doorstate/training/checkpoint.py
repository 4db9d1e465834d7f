# SPDX-License-Identifier: Apache-2.0
"""State of an unfinished training, saved so that a killed run continues exactly where it stopped."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.optim import Optimizer

from doorstate._files import atomic_path
from doorstate.errors import RunError
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
        with atomic_path(self.path) as temporary:
            torch.save(content, temporary)

    def load(self) -> TrainingState:
        """Restore all objects and return the state; a new one if there is no file. Nothing is unpickled.

        Raises:
            RunError: the file is damaged.
        """
        if not self.path.is_file():
            return TrainingState()
        try:
            content: dict[str, Any] = torch.load(self.path, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises many kinds for a damaged file
            raise RunError(
                f"cannot be read ({error})", path=self.path, hint="delete the folder of the run"
            ) from error
        self.network.load_state_dict(content["network"])
        for optimizer, optimizer_state in zip(self.optimizers, content["optimizers"], strict=True):
            optimizer.load_state_dict(optimizer_state)
        self.schedule.load_state_dict(content["schedule"])
        first, second = content["best_score"]
        progress = content["progress"]
        return TrainingState(
            content["log"],
            (first, second),
            content["best_epoch"],
            None if progress is None else EpochProgress(*progress),
        )
