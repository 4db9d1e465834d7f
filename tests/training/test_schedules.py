# SPDX-License-Identifier: Apache-2.0
"""Schedules against closed formulas and the numbers of the authors' code."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.optim import SGD

from doorstate.networks import list_networks
from doorstate.training.recipes import AUTHORS, COMMON, CoarseStage, Recipe, find_recipe
from doorstate.training.schedules import RateSchedule, batchnorm_momentum, resolution_of_epoch

PER_EPOCH = 100


def oracle_rate(recipe: Recipe, iteration: int, per_epoch: int, num_points: int = 4096) -> float:
    """Return the rate of an iteration by one closed formula per schedule."""
    high, low = recipe.learning_rate, recipe.min_learning_rate
    if recipe.schedule == "cosine":
        progress = (iteration // per_epoch) / recipe.epochs
        return low + (high - low) * (1 + math.cos(math.pi * progress)) / 2
    if recipe.schedule == "steps":
        steps = iteration // (recipe.step_iterations or recipe.step_epochs * per_epoch)
        return max(low, high * recipe.step_factor**steps)
    resolutions = [resolution_of_epoch(recipe, epoch, num_points) for epoch in range(recipe.epochs)]
    weights = [math.sqrt(points * centres) for points, centres in resolutions]
    position = iteration / per_epoch
    whole = int(position)
    progress = (sum(weights[:whole]) + (position - whole) * weights[min(whole, recipe.epochs - 1)]) / sum(
        weights
    )
    rise = max(recipe.warmup, 1 / (recipe.epochs * per_epoch))
    if progress < rise:
        return high * (1 / 25 + (1 - 1 / 25) * (1 - math.cos(math.pi * progress / rise)) / 2)
    fall = (progress - rise) / max(1e-9, 1 - rise)
    floor = max(low, high * 1e-4)
    return floor + (high - floor) * (1 + math.cos(math.pi * min(1.0, fall))) / 2


def rates(recipe: Recipe, per_epoch: int, num_points: int = 4096) -> list[float]:
    """Return the rate of every iteration of a training, as an optimizer has it."""
    optimizer = SGD([torch.zeros(1, requires_grad=True)], recipe.learning_rate)
    schedule = RateSchedule(recipe, [optimizer], per_epoch, num_points)
    values = []
    for _ in range(recipe.epochs * per_epoch):
        assert schedule.rate == optimizer.param_groups[0]["lr"]
        values.append(schedule.rate)
        optimizer.step()
        schedule.step()
    return values


@pytest.mark.parametrize(
    ("name", "network"), [(n, w) for n in ("common", "authors") for w in list_networks()]
)
def test_rates_of_all_recipes_equal_the_formulas(name: str, network: str) -> None:
    recipe, per_epoch = find_recipe(name, network), 7
    expected = [oracle_rate(recipe, iteration, per_epoch) for iteration in range(recipe.epochs * per_epoch)]
    assert rates(recipe, per_epoch) == pytest.approx(expected, rel=1e-10)


@given(
    recipe=st.builds(
        Recipe,
        name=st.just("x"),
        epochs=st.integers(1, 8),
        learning_rate=st.floats(1e-4, 1.0),
        min_learning_rate=st.sampled_from([0.0, 1e-5]),
        schedule=st.sampled_from(["one-cycle", "cosine", "steps"]),
        warmup=st.floats(0.05, 0.9),
        step_epochs=st.integers(1, 4),
        step_iterations=st.none() | st.integers(1, 20),
        coarse_to_fine=st.sampled_from(
            [(), (CoarseStage(share=0.4, points=256), CoarseStage(share=0.3, points=1024, centres=0.25))]
        ),
    ),
    per_epoch=st.integers(1, 9),
)
@settings(max_examples=60)
def test_rates_of_any_recipe_equal_the_formulas(recipe: Recipe, per_epoch: int) -> None:
    expected = [oracle_rate(recipe, iteration, per_epoch) for iteration in range(recipe.epochs * per_epoch)]
    assert rates(recipe, per_epoch) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("schedule", ["one-cycle", "cosine", "steps"])
@pytest.mark.parametrize("stop", [1, 5, 6, 11])
def test_restored_schedule_continues_exactly(schedule: str, stop: int) -> None:
    recipe = Recipe.model_validate({"name": "x", "epochs": 4, "schedule": schedule, "step_iterations": 2})
    expected = rates(recipe, 3)

    def build() -> tuple[SGD, RateSchedule]:
        optimizer = SGD([torch.zeros(1, requires_grad=True)], recipe.learning_rate)
        return optimizer, RateSchedule(recipe, [optimizer], 3, 4096)

    optimizer, schedule_before = build()
    for _ in range(stop):
        optimizer.step()
        schedule_before.step()
    resumed, schedule_after = build()
    resumed.load_state_dict(optimizer.state_dict())
    schedule_after.load_state_dict(schedule_before.state_dict())
    remaining = []
    for _ in range(stop, 12):
        remaining.append(resumed.param_groups[0]["lr"])
        resumed.step()
        schedule_after.step()
    assert remaining == expected[stop:]


@pytest.mark.parametrize(
    ("epoch", "rate"), [(0, 1e-3), (19, 1e-3), (20, 7e-4), (40, 4.9e-4), (249, 1e-3 * 0.7**12)]
)
def test_pointnet_rate_falls_every_20_epochs(epoch: int, rate: float) -> None:
    assert rates(AUTHORS["pointnet"], 3)[epoch * 3] == pytest.approx(rate)


def test_lowest_rate_applies_from_step_13_but_not_to_point2sequence() -> None:
    iteration = 13 * 20 * 3
    recipe = AUTHORS["pointnet2"].model_copy(update={"epochs": 300})
    assert rates(recipe, 3)[iteration] == pytest.approx(1e-5)
    assert rates(AUTHORS["point2sequence"], 3)[iteration] == pytest.approx(1e-3 * 0.7**13)


def test_batchnorm_momentum_halves_to_its_lowest() -> None:
    steps = [batchnorm_momentum(AUTHORS["pointnet"], 20 * k * PER_EPOCH, PER_EPOCH) for k in range(8)]
    assert steps == pytest.approx([0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.01, 0.01])
    assert batchnorm_momentum(COMMON, 0, PER_EPOCH) is None


def test_pointcnn_rate_halves_at_iteration_8000() -> None:
    recipe = AUTHORS["pointcnn"].model_copy(update={"epochs": 260})
    values = rates(recipe, 77)
    assert [values[iteration] for iteration in (0, 7999, 8000, 16000)] == pytest.approx(
        [0.01, 0.01, 0.005, 0.0025]
    )


def test_dgcnn_cosine_falls_from_a_tenth_to_a_thousandth() -> None:
    values = rates(AUTHORS["dgcnn"], 2)
    assert values[0] == values[1] == pytest.approx(0.1)
    assert values[125 * 2] == pytest.approx((0.1 + 0.001) / 2)
    assert values[-1] == pytest.approx(0.001, rel=0.01)


def test_one_cycle_rises_to_its_rate_and_falls_to_nearly_0() -> None:
    values = rates(Recipe(name="x", epochs=10, learning_rate=1.0, warmup=0.2), PER_EPOCH)
    assert values[0] == pytest.approx(1 / 25)
    assert max(values) == values[200] == pytest.approx(1.0)
    assert values[:201] == sorted(values[:201])
    assert values[200:] == sorted(values[200:], reverse=True)
    assert values[-1] < 1e-3


def test_epochs_count_as_the_root_of_their_points() -> None:
    # Four epochs of 256 points weigh as much as one of 4096: each half of the cycle takes half of the weight.
    recipe = Recipe(
        name="x",
        epochs=5,
        learning_rate=1.0,
        warmup=0.5,
        coarse_to_fine=(CoarseStage(share=0.8, points=256),),
    )
    values = rates(recipe, PER_EPOCH)
    assert max(values) == values[4 * PER_EPOCH] == pytest.approx(1.0)
    assert values[4 * PER_EPOCH + 50] == pytest.approx(0.5, abs=1e-3)
    assert values[-1] < 1e-3


def test_last_epochs_have_all_points() -> None:
    stages = (CoarseStage(share=0.3, points=256), CoarseStage(share=0.4, points=1024))
    recipe = Recipe(name="x", epochs=10, coarse_to_fine=stages)
    points = [resolution_of_epoch(recipe, epoch, 4096).num_points for epoch in range(10)]
    assert points == [256] * 3 + [1024] * 4 + [4096] * 3
    assert resolution_of_epoch(recipe, 5, 512).num_points == 512, "not more points than the run has"


@pytest.mark.parametrize("epochs", [1, 2, 5])
def test_last_epoch_of_a_short_training_has_all_points(epochs: int) -> None:
    recipe = Recipe(name="x", epochs=epochs, coarse_to_fine=(CoarseStage(share=0.95, points=256),))
    points = [resolution_of_epoch(recipe, epoch, 4096).num_points for epoch in range(epochs)]
    assert points == [256] * (epochs - 1) + [4096]


def test_last_epochs_have_all_centres() -> None:
    stages = (CoarseStage(share=0.5, points=4096, centres=0.25),)
    recipe = Recipe(name="x", epochs=4, coarse_to_fine=stages)
    centres = [resolution_of_epoch(recipe, epoch, 4096).centre_share for epoch in range(4)]
    assert centres == [0.25, 0.25, 1, 1]
