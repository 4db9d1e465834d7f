# SPDX-License-Identifier: Apache-2.0
"""Transfer study: finished weights of several comparisons, tested on unseen samples of several data sets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import Field

from doorstate.clouds.preparation import MAX_NUM_POINTS, MIN_POINTS, NUM_POINTS
from doorstate.dataset.roles import Role
from doorstate.dataset.splits import UNSEEN, origin, read_splits, write_splits
from doorstate.dataset.store import open_dataset
from doorstate.errors import ConfigError, RunError
from doorstate.training.comparison import read_comparison
from doorstate.training.experiment import Experiment
from doorstate.training.study import Study, StudyPart

_Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$", max_length=50)]


class TransferStudy(Study):
    """Fold 0 of finished comparisons, each tested on every data set."""

    trained: dict[_Name, str] = Field(min_length=1)  # folders of comparisons
    tested: dict[_Name, str] = Field(min_length=1)  # folders of prepared data sets
    num_points: int = Field(default=NUM_POINTS, ge=MIN_POINTS, le=MAX_NUM_POINTS)

    def parts(self) -> Iterator[StudyPart]:
        """Yield a comparison for every pair of weights and data set, with those of the networks that have weights.

        Raises:
            ConfigError: a comparison has none of the networks.
            RunError: a comparison is missing.
        """
        for trained, start_from in self.trained.items():
            settings = read_comparison(Path(start_from))
            networks = tuple(network for network in self.networks if network in settings["networks"])
            if not networks:
                raise ConfigError(f"has no weights of {' or '.join(self.networks)}", path=start_from)
            for tested, dataset in self.tested.items():
                experiment = Experiment(
                    name=f"{self.name}: {trained} on {tested}",
                    dataset=dataset,
                    protocol=UNSEEN,
                    networks=networks,
                    folds=1,
                    num_points=self.num_points,
                    recipe_changes={"epochs": 0},
                    start_from=start_from,
                    heads=settings["heads"],
                )
                experiment.check()
                yield StudyPart(Path(trained, tested), experiment)

    def prepare(self, folder: Path) -> None:
        """Write the splits: of a data set, the samples that none of the weights has seen are tested with all weights.

        Raises:
            ConfigError: the weights have seen all samples of a data set.
            RunError: a comparison is missing, or the folder holds a study of other samples.
        """
        trained_scenes = set[str]().union(*(_trained_scenes(Path(path)) for path in self.trained.values()))
        for tested, dataset in self.tested.items():
            roles: dict[str, Role] = {
                row["sample_id"]: "unused" if origin(row) in trained_scenes else "test"
                for row in open_dataset(Path(dataset)).rows
            }
            if "test" not in roles.values():
                raise ConfigError(
                    "every sample was trained on", path=dataset, hint="simulate it with another seed"
                )
            for trained in self.trained:
                path = folder / trained / tested / "splits.csv"
                if not path.is_file():
                    write_splits(path, [roles])
                elif read_splits(path) != [roles]:
                    raise RunError("tests other samples", path=path, hint="choose another folder")


def _trained_scenes(comparison: Path) -> set[str]:
    """Return the scenes of all samples that fold 0 of a comparison was trained or validated on."""
    roles = read_splits(comparison / "splits.csv")[0]
    settings = read_comparison(comparison)
    rows = [
        row
        for row in open_dataset(Path(settings["dataset"])).rows
        if roles[row["sample_id"]] in ("train", "val")
    ]
    for path in settings["extra_train_datasets"]:
        rows += open_dataset(Path(path)).rows
    return {origin(row) for row in rows}
