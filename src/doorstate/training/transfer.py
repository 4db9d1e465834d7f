# SPDX-License-Identifier: Apache-2.0
"""What a training is worth elsewhere: weights of some comparisons tested on data sets that none of them has seen."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.clouds.preparation import NUM_POINTS
from doorstate.dataset.splits import UNSEEN, Role, origin, read_splits, write_splits
from doorstate.dataset.store import open_dataset
from doorstate.errors import ConfigError, RunError
from doorstate.networks import list_networks
from doorstate.training.comparison import Experiment, read_comparison, read_study

_Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")]


class Cell(NamedTuple):
    """Weights of one comparison on one data set."""

    trained: str
    tested: str
    experiment: Experiment

    @property
    def folder(self) -> Path:
        """Of its comparison, within the study's."""
        return Path(self.trained, self.tested)


class TransferStudy(FrozenModel):
    """One flat study file: finished comparisons by name, whose fold 0 is tested, and data sets by name."""

    name: str
    trained: dict[_Name, str] = Field(min_length=1)
    tested: dict[_Name, str] = Field(min_length=1)
    networks: tuple[str, ...] = Field(default_factory=lambda: tuple(list_networks()))
    num_points: int = Field(default=NUM_POINTS, ge=128)

    def cells(self) -> Iterator[Cell]:
        """Every pair of a comparison, with those of the networks that it has, and a data set.

        Raises:
            ConfigError: a comparison has none of them.
            RunError: a comparison is not there.
        """
        for trained, comparison in self.trained.items():
            asked = read_comparison(Path(comparison))
            networks = tuple(network for network in self.networks if network in asked["networks"])
            if not networks:
                raise ConfigError(f"{comparison}: has no {' or '.join(self.networks)}")
            for tested, dataset in self.tested.items():
                experiment = Experiment(
                    name=f"{self.name}: {trained} on {tested}",
                    dataset=dataset,
                    protocol=UNSEEN,
                    networks=networks,
                    folds=1,
                    num_points=self.num_points,
                    recipe_changes={"epochs": 0},
                    start_from=comparison,
                    heads=asked.get("heads", ()),
                )
                experiment.check()
                yield Cell(trained, tested, experiment)

    def write_splits(self, folder: Path) -> None:
        """Choose what each cell tests: the same samples of a data set for all weights, none of which any has seen.

        Raises:
            ConfigError: nothing of a data set is unseen.
            RunError: a comparison is not there, or the folder holds a study of other samples.
        """
        known = set[str]().union(*(_seen(comparison) for comparison in self.trained.values()))
        for tested, dataset in self.tested.items():
            roles: dict[str, Role] = {
                row["sample_id"]: "unused" if origin(row) in known else "test"
                for row in open_dataset(Path(dataset)).rows
            }
            if "test" not in roles.values():
                raise ConfigError(f"{dataset}: every sample was trained on; simulate with another seed")
            for trained in self.trained:
                path = folder / trained / tested / "splits.csv"
                if not path.is_file():
                    write_splits(path, [roles])
                elif read_splits(path) != [roles]:
                    raise RunError(f"{path}: tests other samples; choose another folder")


def load_transfer(path: Path) -> TransferStudy:
    """Read a study file.

    Raises:
        ConfigError: missing, no TOML, or an unknown or wrong value.
    """
    return read_study(path, TransferStudy)


def _seen(comparison: str) -> set[str]:
    """Origins of the samples that fold 0 of a comparison was trained or validated on."""
    roles = read_splits(Path(comparison) / "splits.csv")[0]
    asked = read_comparison(Path(comparison))
    rows = [
        row
        for row in open_dataset(Path(asked["dataset"])).rows
        if roles[row["sample_id"]] in ("train", "val")
    ]
    for more in asked.get("extra_train_datasets", ()):
        rows += open_dataset(Path(more)).rows
    return {origin(row) for row in rows}
