# SPDX-License-Identifier: Apache-2.0
"""Resolution study: accuracy of finished weights on fewer points, with and without fine-tuning."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from doorstate._models import Seed
from doorstate.clouds.preparation import MAX_NUM_POINTS, MIN_POINTS
from doorstate.dataset.splits import NUM_FOLDS
from doorstate.training.experiment import Experiment
from doorstate.training.run_folder import AS_TRAINED, FINE_TUNED
from doorstate.training.study import Study, StudyPart


class ResolutionStudy(Study):
    """Weights of one comparison, tested on several numbers of points."""

    dataset: str
    start_from: str  # folder of a finished comparison
    protocol: str = "paper"
    folds: int = Field(default=1, ge=1, le=NUM_FOLDS)
    points: tuple[Annotated[int, Field(ge=MIN_POINTS, le=MAX_NUM_POINTS)], ...] = Field(min_length=1)
    seed: Seed = 0
    heads: tuple[str, ...] = ()  # those of the weights
    fine_tuning: dict[str, Any] | None = None  # fields of the common recipe; None: no fine-tuning

    def parts(self) -> Iterator[StudyPart]:
        """Yield the comparisons, fewest points first.

        The largest number of points is not fine-tuned: the weights were trained on it.

        Raises:
            ConfigError: a field has a wrong value.
        """
        for points in sorted(self.points):
            yield self._part(AS_TRAINED, points, {"epochs": 0})
            if self.fine_tuning is not None and points < max(self.points):
                yield self._part(FINE_TUNED, points, self.fine_tuning)

    def _part(self, kind: str, points: int, recipe_changes: dict[str, Any]) -> StudyPart:
        name = f"{kind}-{points}"
        experiment = Experiment(
            name=name,
            dataset=self.dataset,
            protocol=self.protocol,
            networks=self.networks,
            folds=self.folds,
            num_points=points,
            seed=self.seed,
            recipe_changes=recipe_changes,
            start_from=self.start_from,
            heads=self.heads,
        )
        experiment.check()
        return StudyPart(Path(name), experiment)
