# SPDX-License-Identifier: Apache-2.0
"""Small prepared data sets, and comparison folders with errors chosen by the test."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from doorstate._files import write_csv
from doorstate.dataset.description import DatasetDescription
from doorstate.dataset.splits import draw_splits, read_splits, write_splits
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.dataset.strata import distance_band, region
from doorstate.simulation.manifest import MANIFEST_FILE, flatten
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import LABELS, NO_DOOR, STATES, Part

POSES = 40
POINTS = 128
NETWORKS = ("pointnet", "dgcnn")
MakeComparison = Callable[..., Path]


def _write_dataset(folder: Path, rows: list[dict[str, str]], kind: str) -> PreparedDataset:
    generator = np.random.default_rng(3)
    folder.mkdir()
    points = generator.uniform(-2.0, 2.0, (len(rows), POINTS, 3)).astype(np.float32)
    np.save(folder / CLOUDS_FILE, points)
    if kind == "simulated":
        parts = generator.choice([Part.WALL, Part.LEAF, Part.FLOOR], (len(rows), POINTS)).astype(np.uint8)
        np.save(folder / PARTS_FILE, parts)
    write_csv(folder / MANIFEST_FILE, rows)
    DatasetDescription.model_validate(
        {"kind": kind, "source": "made", "num_points": POINTS, "samples": len(rows), "doorstate_version": "0"}
    ).save(folder)
    return open_dataset(folder)


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """40 poses of the simulator, never rendered; the semi-open and open frames of the first are called equal."""
    rows = []
    for index in PRESETS["ogurob"].indices(POSES):
        for sample in draw_rows(PRESETS["ogurob"], 7, index):
            strata = {
                "distance_band": distance_band(sample.distance_m),
                "region": region(sample.robot_angle_deg),
            }
            rows.append(flatten(sample) | strata)
    rows[1]["same_image_as"], rows[2]["same_image_as"] = "open", "semi_open"
    return _write_dataset(tmp_path_factory.mktemp("simulated") / "data", rows, "simulated")


@pytest.fixture(scope="session")
def imported(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """Sixty clouds of which only the states are known."""
    rows = [{"sample_id": f"{state}/{n}", "state": state} for n in range(20) for state in STATES]
    return _write_dataset(tmp_path_factory.mktemp("imported") / "data", rows, "imported")


@pytest.fixture(scope="session")
def with_empty_scenes(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """Sixty clouds of doors, and twenty without one."""
    states = (*STATES, NO_DOOR)
    rows = [{"sample_id": f"{state}/{n}", "state": state} for n in range(20) for state in states]
    return _write_dataset(tmp_path_factory.mktemp("empty") / "data", rows, "imported")


@pytest.fixture(scope="session")
def with_unknown_states(tmp_path_factory: pytest.TempPathFactory) -> PreparedDataset:
    """Twenty clouds of each label: doors of every state, no door, and doors whose state is not asked."""
    rows = [
        {"sample_id": f"{label}/{n}", "state": label, "door_kind": "revolving", "scene_kind": "door"}
        | {"distance_band": "1.5-2.0", "region": "red"}
        for n in range(20)
        for label in LABELS
    ]
    return _write_dataset(tmp_path_factory.mktemp("unknown") / "data", rows, "imported")


@pytest.fixture
def make_comparison(tmp_path: Path) -> MakeComparison:
    """Write a comparison folder: all predictions correct, but for those in `wrong[network][sample_id]`."""

    def make(
        dataset: PreparedDataset,
        wrong: Mapping[str, Mapping[str, str]] | None = None,
        networks: Sequence[str] = NETWORKS,
        missing: Sequence[tuple[str, int]] = (),
        name: str = "trial",
        protocol: str = "paper",
    ) -> Path:
        folder = tmp_path / "comparison"
        write_splits(folder / "splits.csv", draw_splits(dataset.rows, protocol, 0))
        document = {
            "name": name,
            "dataset": str(dataset.folder),
            "protocol": protocol,
            "networks": list(networks),
            "folds": 5,
            "num_points": POINTS,
            "seed": 0,
            "recipe": {"name": "common", "epochs": 3},
            "recipe_changes": {},
        }
        (folder / "comparison.json").write_text(json.dumps(document))
        states = {row["sample_id"]: row["state"] for row in dataset.rows}
        for fold, roles in enumerate(read_splits(folder / "splits.csv")):
            tested = [name for name, role in roles.items() if role == "test" and states[name] in STATES]
            for network in networks:
                if (network, fold) not in missing:
                    predicted = {sample_id: states[sample_id] for sample_id in tested}
                    predicted |= {k: v for k, v in (wrong or {}).get(network, {}).items() if k in predicted}
                    _write_run(folder / "runs" / network / f"fold{fold}", states, predicted)
        return folder

    return make


@pytest.fixture
def add_detections() -> Callable[..., None]:
    """Record detections of a method in a sample, in the run that tested it."""

    def add(folder: Path, method: str, sample_id: str, detections: list[list[Any]]) -> None:
        for path in (folder / "runs" / method).rglob("predictions.csv"):
            if f"\n{sample_id}," in path.read_text():
                record = {"sample_id": sample_id, "detections": detections}
                path.with_name("detections.jsonl").write_text(json.dumps(record) + "\n")

    return add


def _write_run(folder: Path, states: Mapping[str, str], predictions: Mapping[str, str]) -> None:
    rows = [
        {"sample_id": sample_id, "state": states[sample_id], "predicted": predicted}
        | {f"p_{state}": "0.7" if state == predicted else "0.15" for state in STATES}
        for sample_id, predicted in predictions.items()
    ]
    write_csv(folder / "predictions.csv", rows)
    log = [
        {"epoch": str(n), "train_loss": str(1 / (n + 1)), "val_loss": str(1 / (n + 2)), "val_macro_f1": "0.9"}
        for n in range(3)
    ]
    write_csv(folder / "log.csv", log)
    metrics = {
        "best_epoch": 2,
        "val_macro_f1": 0.9,
        "test_macro_f1": 1.0,
        "seconds": 12.5,
        "train_samples": 84,
    }
    (folder / "metrics.json").write_text(json.dumps(metrics))
    (folder / "environment.json").write_text(json.dumps({"python": "3.11", "threads": 2}))
