# SPDX-License-Identifier: Apache-2.0
"""Learning rate, batch-norm momentum and cloud resolution over the iterations of a training."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from torch.optim import Optimizer
from torch.optim.lr_scheduler import CosineAnnealingLR, LambdaLR, LRScheduler

from doorstate.training.recipes import Recipe

_FIRST_FACTOR = 1 / 25  # of the highest rate, as in Smith and Topin 2018
_LAST_FACTOR = 1e-4


class Resolution(NamedTuple):
    """Number of points of each cloud, and share of the network's centres, in one epoch."""

    num_points: int
    centre_share: float


class RateSchedule:
    """Learning rate of all optimizers of a training, set by torch's schedulers."""

    def __init__(
        self, recipe: Recipe, optimizers: Sequence[Optimizer], iterations_per_epoch: int, num_points: int
    ) -> None:
        """Set the rate of iteration 0.

        Args:
            recipe: recipe with at least one epoch.
            optimizers: optimizers that were created with the recipe's learning rate.
            iterations_per_epoch: number of iterations in every epoch.
            num_points: points of each cloud in the last epoch.
        """
        self.iteration = 0
        # The authors of DGCNN step the cosine once per epoch.
        self._step_iterations = iterations_per_epoch if recipe.schedule == "cosine" else 1
        self._schedulers: list[LRScheduler]
        if recipe.schedule == "cosine":
            self._schedulers = [
                CosineAnnealingLR(optimizer, recipe.epochs, recipe.min_learning_rate)
                for optimizer in optimizers
            ]
        else:
            factor = (
                _step_factor(recipe, iterations_per_epoch)
                if recipe.schedule == "steps"
                else _one_cycle_factor(recipe, iterations_per_epoch, num_points)
            )
            self._schedulers = [LambdaLR(optimizer, factor) for optimizer in optimizers]

    @property
    def rate(self) -> float:
        """Learning rate of the current iteration."""
        return float(self._schedulers[0].get_last_lr()[0])

    def step(self) -> None:
        """Set the rate of the next iteration; call it after the optimizers' steps."""
        self.iteration += 1
        if self.iteration % self._step_iterations == 0:
            for scheduler in self._schedulers:
                scheduler.step()

    def state_dict(self) -> dict[str, Any]:
        """Return the state, which `torch.load(weights_only=True)` can read."""
        states = [scheduler.state_dict() for scheduler in self._schedulers]
        return {"iteration": self.iteration, "schedulers": states}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore a state; load that of the optimizers too, which hold the rates."""
        self.iteration = state["iteration"]
        for scheduler, scheduler_state in zip(self._schedulers, state["schedulers"], strict=True):
            scheduler.load_state_dict(scheduler_state)


def _step_factor(recipe: Recipe, iterations_per_epoch: int) -> Callable[[int], float]:
    """Return the factor of the highest rate by iteration: `step_factor` per step, not below the lowest rate."""
    lowest = recipe.min_learning_rate / recipe.learning_rate
    return lambda iteration: max(
        lowest, recipe.step_factor ** num_steps(recipe, iteration, iterations_per_epoch)
    )


def _one_cycle_factor(recipe: Recipe, iterations_per_epoch: int, num_points: int) -> Callable[[int], float]:
    """Return the factor of the highest rate by iteration: one cosine up and one down (Smith and Topin 2018).

    `torch.optim.lr_scheduler.OneCycleLR` counts all iterations alike. Here an epoch counts as the square root of its
    points times its centres: few epochs at full resolution after many coarse ones then still have a rate to learn with,
    and the rate falls to its lowest at full resolution.
    """
    resolutions = [resolution_of_epoch(recipe, epoch, num_points) for epoch in range(recipe.epochs)]
    weights = [math.sqrt(points * centre_share) for points, centre_share in resolutions]
    total = sum(weights)
    rise = max(recipe.warmup, 1 / (recipe.epochs * iterations_per_epoch))
    lowest = max(recipe.min_learning_rate / recipe.learning_rate, _LAST_FACTOR)

    def factor(iteration: int) -> float:
        epoch, done = divmod(iteration, iterations_per_epoch)
        current = weights[min(epoch, recipe.epochs - 1)] * done / iterations_per_epoch
        progress = (sum(weights[:epoch]) + current) / total
        if progress < rise:
            return _FIRST_FACTOR + (1 - _FIRST_FACTOR) * (1 - math.cos(math.pi * progress / rise)) / 2
        fall = min(1.0, (progress - rise) / max(1e-9, 1 - rise))
        return lowest + (1 - lowest) * (1 + math.cos(math.pi * fall)) / 2

    return factor


def num_steps(recipe: Recipe, iteration: int, iterations_per_epoch: int) -> int:
    """Return the number of steps of schedule "steps" up to an iteration."""
    return iteration // (recipe.step_iterations or recipe.step_epochs * iterations_per_epoch)


def batchnorm_momentum(recipe: Recipe, iteration: int, iterations_per_epoch: int) -> float | None:
    """Return the weight of the current batch in the running statistics; None leaves torch's."""
    if recipe.batchnorm_momentum is None:
        return None
    first, last = recipe.batchnorm_momentum
    return max(last, first * 0.5 ** num_steps(recipe, iteration, iterations_per_epoch))


def resolution_of_epoch(recipe: Recipe, epoch: int, num_points: int) -> Resolution:
    """Return the resolution of an epoch, counted from 0; the last epoch has all points and centres."""
    end = 0.0
    for stage in recipe.coarse_to_fine:
        end += stage.share
        if epoch < min(round(end * recipe.epochs), recipe.epochs - 1):
            return Resolution(min(stage.points, num_points), stage.centres)
    return Resolution(num_points, 1.0)
