# SPDX-License-Identifier: Apache-2.0
"""Files of `paper/experiments/`: the command of an experiment, its data sets and the weights it starts from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from doorstate._documents import read_toml

from . import paths


@dataclass(frozen=True)
class Definition:
    """One file of `paper/experiments/`."""

    name: str
    content: dict[str, Any]

    @property
    def command(self) -> Literal["compare", "resolution", "transfer"]:
        """Command of doorstate: `compare` trains; `transfer` and `resolution` test trained weights."""
        if "tested" in self.content:
            return "transfer"
        return "resolution" if "points" in self.content else "compare"

    @property
    def is_study(self) -> bool:
        """True for an experiment that consists of several comparisons."""
        return self.command != "compare"

    @property
    def starts_from(self) -> list[str]:
        """Names of the experiments whose weights are needed."""
        folders = self.content.get("trained", {}).values() or filter(None, [self.content.get("start_from")])
        return [Path(folder).name for folder in folders]

    @property
    def datasets(self) -> list[Path]:
        """Prepared data sets that are needed, relative to the repository."""
        tested = self.content.get("tested", {}).values() or [self.content["dataset"]]
        return [Path(folder) for folder in (*tested, *self.content.get("extra_train_datasets", ()))]


def read_definition(name: str) -> Definition:
    """Read the definition of an experiment by name.

    Raises:
        FileNotFoundError: there is no such file.
    """
    path = paths.EXPERIMENTS / f"{name}.toml"
    return Definition(name, read_toml(path))


def read_definitions() -> Iterator[Definition]:
    """Read all definitions, by name."""
    return (read_definition(path.stem) for path in sorted(paths.EXPERIMENTS.glob("*.toml")))
