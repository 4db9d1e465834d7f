# SPDX-License-Identifier: Apache-2.0
"""Files of paper/experiments/, and published results of the studies among them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from doorstate.evaluation.resolution import (
    ResolutionResults,
    load_resolution,
    resolution_table,
    write_resolution,
)
from doorstate.evaluation.table import Table
from doorstate.evaluation.transfer import (
    TransferResults,
    load_transfer_results,
    transfer_table,
    write_transfer,
)


class Asked(NamedTuple):
    """A file of paper/experiments/, by what it says."""

    name: str
    content: dict[str, Any]

    @property
    def command(self) -> str:
        """Of doorstate: `compare` trains; `transfer` and `resolution` begin with trained weights."""
        if "tested" in self.content:
            return "transfer"
        return "resolution" if "points" in self.content else "compare"

    @property
    def begins_with(self) -> list[str]:
        """Names of the experiments whose weights it asks."""
        folders = self.content.get("trained", {}).values() or filter(None, [self.content.get("start_from")])
        return [Path(folder).name for folder in folders]

    @property
    def datasets(self) -> list[Path]:
        """Prepared data sets that it needs."""
        tested = self.content.get("tested", {}).values() or [self.content["dataset"]]
        return [Path(each) for each in (*tested, *self.content.get("extra_train_datasets", ()))]


def read_asked(path: Path) -> Asked:
    """Read a file of paper/experiments/."""
    return Asked(path.stem, tomllib.loads(path.read_text(encoding="utf-8")))


def study_table(asked: Asked, results_folder: Path) -> Table:
    """What is published of a study, as its table.

    Args:
        asked: of command `transfer` or `resolution`.
        results_folder: everything published.
    """
    if asked.command == "transfer":
        return transfer_table(_transfer_results(asked, results_folder))
    return resolution_table(resolution_results(asked, results_folder))


def resolution_results(asked: Asked, results_folder: Path) -> ResolutionResults:
    """What is published of a study of command `resolution`."""
    return load_resolution(results_folder / asked.name, _rows(asked, results_folder))


def write_study(asked: Asked, results_folder: Path, out_folder: Path) -> None:
    """Write tables and figures of a published study.

    Args:
        asked: of command `transfer` or `resolution`.
        results_folder: everything published.
        out_folder: made if absent.
    """
    if asked.command == "transfer":
        write_transfer(_transfer_results(asked, results_folder), out_folder)
    else:
        write_resolution(results_folder / asked.name, out_folder, _rows(asked, results_folder))


def _transfer_results(asked: Asked, results_folder: Path) -> TransferResults:
    folder, content = results_folder / asked.name, asked.content
    return load_transfer_results(folder, tuple(content["trained"]), tuple(content["tested"]), results_folder)


def _rows(asked: Asked, results_folder: Path) -> Path:
    (dataset,) = asked.datasets
    return results_folder / dataset.name
