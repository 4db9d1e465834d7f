# SPDX-License-Identifier: Apache-2.0
"""Studies: comparisons that test finished weights under other conditions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

from pydantic import Field, ValidationError

from doorstate._documents import read_toml
from doorstate._models import FrozenModel, Name
from doorstate.errors import ConfigError, first_validation_error
from doorstate.networks import list_networks
from doorstate.training.experiment import Experiment

S = TypeVar("S", bound="Study")


class StudyPart(NamedTuple):
    """One comparison of a study."""

    folder: Path  # within that of the study
    experiment: Experiment


class Study(FrozenModel, ABC):
    """Configuration of a study: one flat TOML file."""

    name: Name
    networks: tuple[Name, ...] = Field(default_factory=lambda: tuple(list_networks()))

    @abstractmethod
    def parts(self) -> Iterator[StudyPart]:
        """Yield the comparisons in the order in which they are run.

        Raises:
            ConfigError: a field has a wrong value.
            RunError: a comparison to start from is missing.
        """

    def prepare(self, folder: Path) -> None:
        """Write into the study's folder what its comparisons need; nothing by default."""


def load_study(path: Path, kind: type[S]) -> S:
    """Return a study of one kind from a TOML file, named after the file unless it has a name.

    Raises:
        ConfigError: the file cannot be read, or a field is unknown or has a wrong value.
    """
    try:
        return kind.model_validate({"name": path.stem} | read_toml(path))
    except ValidationError as error:
        raise ConfigError(first_validation_error(error, kind.model_fields), path=path) from error
