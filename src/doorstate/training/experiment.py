# SPDX-License-Identifier: Apache-2.0
"""Experiment files: the methods, data, folds and recipe of one comparison."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field, SerializerFunctionWrapHandler, ValidationError, model_serializer

from doorstate._documents import read_toml
from doorstate._models import FrozenModel, Name, Seed, without_defaults
from doorstate.clouds.preparation import MAX_NUM_POINTS, MIN_POINTS, NUM_POINTS
from doorstate.dataset.splits import NUM_FOLDS, ONE_FOLD, PROTOCOLS, UNSEEN
from doorstate.errors import ConfigError, first_validation_error
from doorstate.networks import create_network, list_networks, network_class
from doorstate.networks.head_layers import add_heads
from doorstate.networks.heads import STATE
from doorstate.rules import create_rule
from doorstate.training.recipes import Recipe, find_recipe
from doorstate.types import PARTS


class Experiment(FrozenModel):
    """Configuration of one comparison: one flat TOML file."""

    name: Name
    dataset: str
    protocol: str = "paper"
    networks: tuple[Name, ...] = Field(default_factory=lambda: tuple(list_networks()))
    rules: tuple[Name, ...] = ()  # tested on the same samples; nothing is trained
    folds: int = Field(default=NUM_FOLDS, ge=1, le=NUM_FOLDS)  # number of folds to run
    num_points: int = Field(default=NUM_POINTS, ge=MIN_POINTS, le=MAX_NUM_POINTS)
    seed: Seed = 0
    recipe: str = "common"
    recipe_changes: dict[str, Any] = Field(default_factory=dict)  # fields of the recipe
    # By network; these win over `recipe_changes`.
    network_changes: dict[str, dict[str, Any]] = Field(default_factory=dict)
    # By network: arguments of its class.
    network_options: dict[str, dict[str, Any]] = Field(default_factory=dict)
    # Folder of a comparison: runs start from its weights of the same network and fold. Networks that it does not have
    # start from random weights.
    start_from: str | None = None
    heads: tuple[str, ...] = ()  # heads besides the state, trained jointly
    extra_train_datasets: tuple[str, ...] = ()  # all samples are trained on in every fold, and never tested
    train_share: float = Field(default=1.0, gt=0, le=1)  # of the scenes that are trained on

    @model_serializer(mode="wrap")
    def _leave_out_new_field(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # So that comparisons of earlier versions go on.
        return without_defaults(dump(self), {"train_share": 1.0})

    @property
    def methods(self) -> tuple[str, ...]:
        """Networks and rules."""
        return self.networks + self.rules

    def recipe_of(self, network: str) -> Recipe:
        """Return the recipe of a network with all changes.

        Raises:
            ConfigError: there is no such recipe, or a change does not fit it.
        """
        recipe = find_recipe(self.recipe, network)
        changes = self.recipe_changes | self.network_changes.get(network, {})
        try:
            return Recipe.model_validate(recipe.model_dump() | changes)
        except ValidationError as error:
            raise self._error("recipe_changes", first_validation_error(error, Recipe.model_fields)) from error

    def heads_of(self, network: str) -> tuple[str, ...]:
        """Return the heads of a network: "parts" only if it has features of single points."""
        has_points = network_class(network).has_point_features
        return tuple(name for name in self.heads if has_points or name != PARTS)

    def check(self) -> None:
        """Check all names before anything is trained.

        Raises:
            ConfigError: a name does not exist, or two fields do not fit each other.
        """
        if self.protocol not in PROTOCOLS:
            raise self._error("protocol", f"no protocol {self.protocol!r}", " or ".join(PROTOCOLS))
        if self.protocol in ONE_FOLD and self.folds != 1:
            raise self._error("folds", f"protocol {self.protocol} has one fold", "1")
        for name in (*self.network_changes, *self.network_options):
            network_class(name)
        for network in self.networks:
            self._check_network(network)
        for rule in self.rules:
            create_rule(rule)

    def _check_network(self, network: str) -> None:
        recipe = self.recipe_of(network)
        add_heads(create_network(network, **self.network_options.get(network, {})), self.heads_of(network))
        if recipe.epochs and self.protocol == UNSEEN:
            raise self._error("recipe_changes.epochs", f"protocol {UNSEEN} trains nothing", "0")
        heads = (STATE, *self.heads)
        for name in recipe.loss_weights:
            if name not in heads:
                raise self._error("loss_weights", f"{network} has no head {name!r}", " or ".join(heads))

    def _error(self, field: str, message: str, expected: str | None = None) -> ConfigError:
        return ConfigError(f"experiment {self.name}: {message}", field=field, expected=expected)


def load_experiment(path: Path | None, overrides: Mapping[str, Any]) -> Experiment:
    """Return an experiment from a file and overrides, which win over the file.

    Args:
        path: TOML file; None if the overrides are complete.
        overrides: fields by name; `recipe_changes` are merged with those of the file and also win over
            `network_changes`.

    Raises:
        ConfigError: the file cannot be read, or a field is unknown or has a wrong value.
    """
    values: dict[str, Any] = {}
    if path is not None:
        values = {"name": path.stem} | read_toml(path)
    fields = dict(overrides)
    changes = fields.pop("recipe_changes", {})
    try:
        experiment = Experiment.model_validate(values | fields)
    except ValidationError as error:
        raise ConfigError(first_validation_error(error, Experiment.model_fields), path=path) from error
    experiment = experiment.model_copy(
        update={
            "recipe_changes": experiment.recipe_changes | changes,
            "network_changes": {
                network: network_changes | changes
                for network, network_changes in experiment.network_changes.items()
            },
        }
    )
    experiment.check()
    return experiment
