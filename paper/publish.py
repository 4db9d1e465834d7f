# SPDX-License-Identifier: Apache-2.0
"""What results/ holds of a comparison: all that is small, and of its data set the tested rows, which replay it."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from doorstate._files import write_csv
from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import MANIFEST, open_dataset
from doorstate.networks.packaged import packaged_weights
from doorstate.training.run_folder import read_json

# Large, or of use only to a running training.
_LEFT_OUT = ("*.safetensors", "*.pt", "position.txt", "report")


def publish(source: Path, target: Path) -> None:
    """Copy the finished runs of a comparison, or of all comparisons of a study; unfinished ones are left out.

    Args:
        source: as a command left it.
        target: in the folder of everything published.
    """
    if not source.is_dir():
        sys.exit(f"{source}: no such folder; run it first")

    def skipped(folder: str, names: list[str]) -> set[str]:
        left = set(shutil.ignore_patterns(*_LEFT_OUT)(folder, names))
        return set(names) if "config.json" in names and "metrics.json" not in names else left

    shutil.copytree(source, target, ignore=skipped, dirs_exist_ok=True)
    for path in source.rglob("comparison.json"):
        _publish_rows(path.parent, target.parent)


def restore(source: Path, target: Path, prefix: str = "") -> None:
    """A published comparison as if it had been run here, with the packaged weights of its networks, float16.

    Args:
        source: in the folder of everything published.
        target: where a command would have left it; not there yet.
        prefix: before a network's name in the name of its packaged weights.
    """
    if target.exists():
        sys.exit(f"{target}: is there already")
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("report"))
    for folder in sorted(target.glob("runs/*/fold0")):
        weights = packaged_weights(f"{prefix}{folder.parent.name}") if _is_network(folder) else None
        if weights is not None:
            shutil.copyfile(weights, folder / "weights.safetensors")
            print(f"{folder}: weights of the package, rounded to float16")


def _is_network(run: Path) -> bool:
    return "network" in read_json(run / "config.json")


def rows_of(comparison: Path, published: Path) -> Path:
    """Where the rows of a comparison's data set are.

    Args:
        comparison: a published one.
        published: folder of everything published.
    """
    return published / Path(read_json(comparison / "comparison.json")["dataset"]).name


def _publish_rows(comparison: Path, published: Path) -> None:
    folder = rows_of(comparison, published)
    if folder.is_dir():
        return
    asked = read_json(comparison / "comparison.json")
    roles = read_splits(comparison / "splits.csv")[: asked["folds"]]
    tested = {sample for fold in roles for sample, role in fold.items() if role == "test"}
    dataset = open_dataset(Path(asked["dataset"]))
    rows = [row for row in dataset.rows if row["sample_id"] in tested]
    write_csv(folder / MANIFEST, rows)
    dataset.description.model_copy(update={"samples": len(rows), "clouds": "replayed"}).save(folder)
