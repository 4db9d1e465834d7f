# SPDX-License-Identifier: Apache-2.0
"""Data that are swapped under a run or a comparison."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from tests.attack.processes import run
from tests.attack.samples import POINTS, prepared
from tests.attack.tries import Try, Violation


def attack_contents(folder: Path, rounds: int) -> Iterator[Try]:
    """Give a comparison and a run data of another seed under the same names, then go on and report."""
    data, other = prepared(folder / "data", 0, 12), prepared(folder / "other", 1, 12)
    options = ["--network", "pointnet", "--data", data, "--points", POINTS, "--epochs", 1]
    compare = ["compare", *options, "--folds", 1, "--out", folder / "study"]
    train = ["train", *options, "--out", folder / "run"]
    assert [run(folder, *line).code for line in (compare, train)] == [0, 0]
    (folder / "study" / "runs" / "pointnet" / "fold0" / "metrics.json").unlink()  # half done
    (folder / "run" / "metrics.json").unlink()
    data.rename(folder / "before")
    shutil.copytree(other, data)
    for line in (compare, train):
        done = run(folder, *line)
        kind = f"data swapped under half a `{line[0]}`"
        yield done.as_try(kind) if done.code else Try(kind, "accepted", Violation.TORN)
    shutil.rmtree(data)
    shutil.copytree(folder / "before", data)
    assert [run(folder, *line).code for line in (compare, train)] == [0, 0]
    shutil.rmtree(data)
    shutil.copytree(other, data)
    for out in ("study", "run"):
        done = run(folder, "report", folder / out)
        kind = "data swapped before `report`"
        yield done.as_try(kind) if done.code else Try(kind, "accepted", Violation.TORN)
