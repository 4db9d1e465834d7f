# SPDX-License-Identifier: Apache-2.0
"""Recipes: names, fields, and values of the authors."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from doorstate.errors import ConfigError
from doorstate.networks import list_networks
from doorstate.training.recipes import AUTHORS, COMMON, CoarseStage, Recipe, find_recipe
from doorstate.training.schedules import resolution_of_epoch


def test_every_network_has_a_recipe_of_its_authors() -> None:
    assert sorted(AUTHORS) == sorted(list_networks())


@pytest.mark.parametrize("network", list_networks())
def test_common_recipe_differs_between_networks_in_four_fields(network: str) -> None:
    recipe = find_recipe("common", network)
    fields = ("epochs", "coarse_to_fine", "batch_size", "learning_rate")
    assert recipe.model_copy(update={name: getattr(COMMON, name) for name in fields}) == COMMON
    assert resolution_of_epoch(recipe, recipe.epochs - 1, 4096) == (4096, 1.0)


def test_common_recipe_has_defaults_for_other_networks() -> None:
    assert find_recipe("common", "mvcnn") == COMMON


@pytest.mark.parametrize("recipe", [COMMON, *AUTHORS.values()])
def test_recipe_is_the_same_after_json(recipe: Recipe) -> None:
    assert Recipe.model_validate_json(recipe.model_dump_json()) == recipe


@pytest.mark.parametrize("name", ["typo", "Common", ""])
def test_unknown_recipe_is_refused(name: str) -> None:
    with pytest.raises(ConfigError) as caught:
        find_recipe(name, "pointnet")
    assert (caught.value.field, caught.value.expected) == ("recipe", "common or doorways or authors")


def test_coarse_stages_must_leave_epochs_for_all_points() -> None:
    with pytest.raises(ValidationError, match="coarse_to_fine"):
        Recipe(name="x", epochs=10, coarse_to_fine=(CoarseStage(share=1.0, points=256),))


def test_unknown_field_is_refused() -> None:
    with pytest.raises(ValidationError, match="learning_rat"):
        Recipe.model_validate({"name": "x", "learning_rat": 1.0})


def test_label_smoothing_of_dgcnn_is_that_of_the_authors() -> None:
    # torch gives the true class 1 - e + e/3 and the other classes e/3; the authors' code 0.8, 0.1 and 0.1.
    smoothing = AUTHORS["dgcnn"].label_smoothing
    assert 1 - smoothing + smoothing / 3 == pytest.approx(0.8)
    assert smoothing / 3 == pytest.approx(0.1)
    assert AUTHORS["pointnet"].label_smoothing == 0.0


def test_corruption_is_off_and_then_not_stored_so_that_earlier_runs_go_on() -> None:
    assert Recipe(name="plain").corruption.changes_nothing
    assert "corruption" not in Recipe(name="plain").model_dump()
    changed = Recipe.model_validate(
        {
            "name": "corrupted",
            "corruption": {"cut_outs": 2, "cut_sides_m": [0.1, 0.4], "holes": 0.25, "mix": 0.2},
        }
    )
    assert changed.corruption.cut_sides_m == (0.1, 0.4)
    assert Recipe.model_validate_json(changed.model_dump_json()) == changed
