# SPDX-License-Identifier: Apache-2.0
"""Configuration of one run: one network trained on one fold."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from doorstate._models import FrozenModel, Name, Seed, without_defaults
from doorstate.clouds.preparation import MAX_NUM_POINTS, MIN_POINTS
from doorstate.dataset.splits import NUM_FOLDS
from doorstate.training.recipes import Recipe


class RunConfig(FrozenModel):
    """Configuration of a run, stored in its folder; a folder is continued only with the same configuration."""

    network: Name
    network_options: dict[str, Any] = Field(default_factory=dict)
    dataset: str
    protocol: str
    fold: int = Field(ge=0, lt=NUM_FOLDS)
    num_points: int = Field(ge=MIN_POINTS, le=MAX_NUM_POINTS)
    seed: Seed
    recipe: Recipe
    start_from: str | None = None  # weights file to start from
    heads: tuple[str, ...] = ()  # heads besides the state (networks.heads)
    extra_train_datasets: tuple[str, ...] = ()  # all samples of these are trained on in addition to the fold

    # Of the scenes that the fold and the other data sets train on.
    train_share: float = Field(default=1.0, gt=0, le=1)

    @model_serializer(mode="wrap")
    def _leave_out_new_field(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # So that runs of earlier versions go on.
        return without_defaults(dump(self), {"train_share": 1.0})

    @property
    def all_network_options(self) -> dict[str, Any]:
        """Options of the network, including those that the recipe sets."""
        eps = self.recipe.batchnorm_eps
        return self.network_options | ({} if eps is None else {"batchnorm_eps": eps})

    def torch_seed(self, stage: int, *part: int) -> int:
        """Seed of torch for a stage: 0 for the initial weights, `epoch + 1` for an epoch; or for a part of it."""
        return int(np.random.SeedSequence([self.seed, self.fold, stage, *part]).generate_state(1)[0])
