# SPDX-License-Identifier: Apache-2.0
"""Schedules against the numbers that the authors' code gives (NETWORKS sections 2 to 6)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from doorstate.errors import ConfigError
from doorstate.networks import list_networks
from doorstate.training.recipes import (
    AUTHORS,
    COMMON,
    Recipe,
    Stage,
    batchnorm_momentum,
    find_recipe,
    learning_rate,
    resolution_of_epoch,
)

PER_EPOCH = 100


def test_every_network_has_an_authors_recipe() -> None:
    assert sorted(AUTHORS) == sorted(list_networks())


@pytest.mark.parametrize("network", list_networks())
def test_the_common_recipe_differs_in_length_and_batch_and_ends_on_everything(network: str) -> None:
    recipe = find_recipe("common", network)
    own = ("epochs", "coarse_to_fine", "batch_size", "learning_rate")
    assert recipe.model_copy(update={name: getattr(COMMON, name) for name in own}) == COMMON
    assert resolution_of_epoch(recipe, recipe.epochs - 1, 4096) == (4096, 1.0)
    assert find_recipe("common", "mvcnn") == COMMON


def test_a_recipe_without_what_came_later_is_written_as_before() -> None:
    changed = COMMON.model_copy(update={"clouds_per_epoch": 100, "loss_weights": {"state": 2.0}})
    assert not {"clouds_per_epoch", "loss_weights"} & set(COMMON.model_dump(mode="json"))
    assert Recipe.model_validate(changed.model_dump(mode="json")) == changed != COMMON


@pytest.mark.parametrize("name", ["typo", "Common", ""])
def test_an_unknown_recipe_is_named(name: str) -> None:
    with pytest.raises(ConfigError, match="choose common or authors"):
        find_recipe(name, "pointnet")


@pytest.mark.parametrize(
    ("epoch", "rate"), [(0, 1e-3), (19, 1e-3), (20, 7e-4), (40, 4.9e-4), (249, 1e-3 * 0.7**12)]
)
def test_pointnet_rate_falls_every_20_epochs(epoch: int, rate: float) -> None:
    assert learning_rate(AUTHORS["pointnet"], epoch * PER_EPOCH, PER_EPOCH) == pytest.approx(rate)


def test_the_floor_binds_at_the_13th_step_but_not_for_point2sequence() -> None:
    iteration = 13 * 20 * PER_EPOCH
    assert learning_rate(AUTHORS["pointnet2"], iteration, PER_EPOCH) == 1e-5
    assert learning_rate(AUTHORS["point2sequence"], iteration, PER_EPOCH) == pytest.approx(1e-3 * 0.7**13)


def test_batchnorm_momentum_halves_to_its_floor() -> None:
    steps = [batchnorm_momentum(AUTHORS["pointnet"], 20 * k * PER_EPOCH, PER_EPOCH) for k in range(8)]
    assert steps == pytest.approx([0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.01, 0.01])
    assert batchnorm_momentum(COMMON, 0, PER_EPOCH) is None


def test_pointcnn_rate_halves_at_iteration_8000() -> None:
    recipe = AUTHORS["pointcnn"]
    assert [learning_rate(recipe, i, 77) for i in (0, 7999, 8000, 16000)] == pytest.approx(
        [0.01, 0.01, 0.005, 0.0025]
    )
    # 1024 epochs of 77 iterations end at 1.95e-5.
    assert learning_rate(recipe, 1024 * 77 - 1, 77) == pytest.approx(1.953e-5, rel=1e-3)


def test_dgcnn_cosine_goes_from_a_tenth_to_a_thousandth() -> None:
    recipe = AUTHORS["dgcnn"]
    assert learning_rate(recipe, 0, PER_EPOCH) == pytest.approx(0.1)
    assert learning_rate(recipe, 125 * PER_EPOCH, PER_EPOCH) == pytest.approx((0.1 + 0.001) / 2)
    assert learning_rate(recipe, 250 * PER_EPOCH, PER_EPOCH) == pytest.approx(0.001)


def test_one_cycle_rises_to_its_rate_and_falls_to_nearly_nothing() -> None:
    recipe = Recipe(name="x", epochs=10, learning_rate=1.0, warmup=0.2)
    rates = [learning_rate(recipe, i, PER_EPOCH) for i in range(1000)]
    assert rates[0] == pytest.approx(1 / 25)
    assert max(rates) == rates[200] == pytest.approx(1.0)
    assert rates[:201] == sorted(rates[:201])
    assert rates[200:] == sorted(rates[200:], reverse=True)
    assert rates[-1] < 1e-3


@given(
    iteration=st.integers(0, 10**6), per_epoch=st.integers(1, 1000), network=st.sampled_from(sorted(AUTHORS))
)
@settings(deadline=None, max_examples=200)
def test_rates_stay_within_their_bounds(iteration: int, per_epoch: int, network: str) -> None:
    recipe = AUTHORS[network]
    iteration %= recipe.epochs * per_epoch
    assert recipe.min_learning_rate <= learning_rate(recipe, iteration, per_epoch) <= recipe.learning_rate


def test_coarse_to_fine_ends_on_all_points() -> None:
    recipe = Recipe(
        name="x", epochs=10, coarse_to_fine=(Stage(share=0.3, points=256), Stage(share=0.4, points=1024))
    )
    points = [resolution_of_epoch(recipe, epoch, 4096).points for epoch in range(10)]
    assert points == [256] * 3 + [1024] * 4 + [4096] * 3
    assert resolution_of_epoch(recipe, 5, 512).points == 512, "never more points than the run has"


@pytest.mark.parametrize("epochs", [1, 2, 5])
def test_even_a_short_training_ends_on_all_points(epochs: int) -> None:
    recipe = Recipe(name="x", epochs=epochs, coarse_to_fine=(Stage(share=0.95, points=256),))
    points = [resolution_of_epoch(recipe, epoch, 4096).points for epoch in range(epochs)]
    assert points == [256] * (epochs - 1) + [4096]


def test_the_last_stage_has_all_centres() -> None:
    recipe = Recipe(name="x", epochs=4, coarse_to_fine=(Stage(share=0.5, points=4096, centres=0.25),))
    assert [resolution_of_epoch(recipe, epoch, 4096).centres for epoch in range(4)] == [0.25, 0.25, 1, 1]


def test_a_fine_epoch_moves_the_rate_as_far_as_the_root_of_its_points() -> None:
    # Four epochs of 256 points weigh as much as one of 4096: both halves take half of the cycle.
    recipe = Recipe(
        name="x", epochs=5, learning_rate=1.0, warmup=0.5, coarse_to_fine=(Stage(share=0.8, points=256),)
    )
    rates = [learning_rate(recipe, i, PER_EPOCH) for i in range(5 * PER_EPOCH)]
    assert max(rates) == rates[4 * PER_EPOCH] == pytest.approx(1.0)
    assert rates[4 * PER_EPOCH + 50] == pytest.approx(0.5, abs=1e-3)
    assert rates[-1] < 1e-3


def test_coarse_to_fine_must_leave_epochs_for_all_points() -> None:
    recipe = Recipe(name="x", epochs=10, coarse_to_fine=(Stage(share=1.0, points=256),))
    with pytest.raises(ConfigError, match="leave some for all points"):
        resolution_of_epoch(recipe, 10, 4096)


def test_an_unknown_field_is_refused() -> None:
    with pytest.raises(ValidationError, match="Extra inputs"):
        Recipe.model_validate({"name": "x", "learning_rat": 1.0})


def test_dgcnn_smoothing_is_the_authors_share() -> None:
    # torch gives the true class 1 - e + e/3 and each other e/3; the authors' repository 0.8 / 0.1 / 0.1.
    smoothing = AUTHORS["dgcnn"].label_smoothing
    assert 1 - smoothing + smoothing / 3 == pytest.approx(0.8)
    assert smoothing / 3 == pytest.approx(0.1)
    assert math.isclose(AUTHORS["pointnet"].label_smoothing, 0.0)
