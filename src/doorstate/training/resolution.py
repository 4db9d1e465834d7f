# SPDX-License-Identifier: Apache-2.0
"""How many points does a network need: finished weights tested on fewer points, as they are and trained on a little."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.clouds.preparation import MIN_POINTS
from doorstate.networks import list_networks
from doorstate.training.comparison import Experiment, read_study
from doorstate.training.run_folder import AS_TRAINED, FINE_TUNED


class ResolutionStudy(FrozenModel):
    """One flat study file: which weights, on how many points."""

    name: str
    dataset: str
    start_from: str  # a finished comparison
    protocol: str = "paper"
    networks: tuple[str, ...] = Field(default_factory=lambda: tuple(list_networks()))
    folds: int = Field(default=1, ge=1)
    points: tuple[Annotated[int, Field(ge=MIN_POINTS)], ...] = Field(min_length=1)
    seed: int = 0
    heads: tuple[str, ...] = ()  # those of the weights
    fine_tuning: dict[str, Any] | None = None  # fields of the common recipe; without it nothing is trained

    def experiments(self) -> Iterator[tuple[str, Experiment]]:
        """Name and content of the comparisons that the study is made of, the coarsest first.

        Weights are not fine-tuned on as many points as they were trained on: that is what they were trained for.
        """
        for points in sorted(self.points):
            yield self._experiment(AS_TRAINED, points, {"epochs": 0})
            if self.fine_tuning is not None and points < max(self.points):
                yield self._experiment(FINE_TUNED, points, self.fine_tuning)

    def _experiment(self, kind: str, points: int, changes: dict[str, Any]) -> tuple[str, Experiment]:
        name = f"{kind}-{points}"
        return name, Experiment(
            name=name,
            dataset=self.dataset,
            protocol=self.protocol,
            networks=self.networks,
            folds=self.folds,
            num_points=points,
            seed=self.seed,
            recipe_changes=changes,
            start_from=self.start_from,
            heads=self.heads,
        )


def load_study(path: Path) -> ResolutionStudy:
    """Read a study file.

    Raises:
        ConfigError: missing, no TOML, or an unknown or wrong value.
    """
    study = read_study(path, ResolutionStudy)
    for _, experiment in study.experiments():
        experiment.check()
    return study
