# SPDX-License-Identifier: Apache-2.0
"""The files of one run: config, environment, log, checkpoint, weights, predictions, and metrics last of all."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from doorstate._files import read_csv, write_csv, write_text
from doorstate.errors import RunError
from doorstate.types import STATES

AS_TRAINED, FINE_TUNED = "as-trained", "fine-tuned"  # parts of a resolution study: folders AS_TRAINED-POINTS

_SINCE: dict[str, Any] = {
    "heads": [],
    "rules": [],
    "extra_train_datasets": [],
}  # of settings: what older folders do not know


class RunFolder:
    """One run on disk; it is finished once `metrics.json` is there."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config = path / "config.json"
        self.environment = path / "environment.json"
        self.log = path / "log.csv"
        self.position = path / "position.txt"
        self.checkpoint = path / "checkpoint.pt"
        self.weights = path / "weights.safetensors"
        self.predictions = path / "predictions.csv"
        self.validation = path / "validation.csv"  # the same of the samples that the epoch was chosen on
        self.head_outputs = path / "head_outputs.csv"  # of further heads, for all test samples
        self.detections = path / "detections.jsonl"  # of a rule, for the test samples that it got wrong
        self.metrics = path / "metrics.json"

    @property
    def finished(self) -> bool:
        """Whether the run has been tested, so that nothing is left to do."""
        return self.metrics.is_file()

    def claim(self, config: Mapping[str, Any], environment: Mapping[str, Any]) -> None:
        """Begin the run, or make sure that the folder holds this very run.

        Raises:
            RunError: the folder holds another run.
        """
        if self.config.is_file():
            check_same(self.config, config, "a run")
        else:
            write_json(self.config, config)
        if not self.finished:
            write_json(self.environment, environment)

    def write_position(self, epochs: float) -> None:
        """Say how far the training is, in epochs; for whoever watches, nothing depends on it."""
        write_text(self.position, f"{epochs:.3f}\n")

    def read_position(self) -> float:
        """How far the training is, in epochs; 0 if nobody knows."""
        try:
            return float(self.position.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return 0.0

    def read_metrics(self) -> dict[str, Any]:
        """Metrics of a finished run."""
        return read_json(self.metrics)

    def write_log(self, lines: Sequence[Mapping[str, float]]) -> None:
        """Write one line per epoch."""
        write_csv(self.log, [{key: f"{value:.6g}" for key, value in line.items()} for line in lines])

    def read_log(self) -> list[dict[str, str]]:
        """One line per epoch done so far."""
        return read_csv(self.log) if self.log.is_file() else []

    def finish(self, metrics: Mapping[str, Any]) -> None:
        """Write the metrics, and drop what only a running training needs."""
        write_json(self.metrics, metrics)
        self.checkpoint.unlink(missing_ok=True)
        self.position.unlink(missing_ok=True)


def run_of(folder: Path, network: str, fold: int) -> RunFolder:
    """Where the run of a network or rule on one fold lies in a comparison's folder."""
    return RunFolder(folder / "runs" / network / f"fold{fold}")


def check_same(path: Path, settings: Mapping[str, Any], what: str) -> None:
    """Raise RunError unless a folder's file holds these settings, or those of an older version that mean the same."""
    found = {key: value for key, value in _SINCE.items() if key in settings} | read_json(path)
    changed = sorted(key for key in {*found, *settings} if found.get(key) != settings.get(key))
    if changed:
        raise RunError(
            f"{path.parent}: holds {what} with another {', '.join(changed)}; choose another folder"
        )


def write_predictions(
    path: Path, samples: Sequence[str], labels: np.ndarray, probabilities: np.ndarray
) -> None:
    """Write states and probabilities (M, 3), small ones too: temperature scaling needs their logarithms."""
    write_csv(
        path,
        [
            {
                "sample_id": sample,
                "state": STATES[label],
                "predicted": STATES[int(row.argmax())],
                **{f"p_{state}": f"{p:.5g}" for state, p in zip(STATES, row, strict=True)},
            }
            for sample, label, row in zip(samples, labels, probabilities, strict=True)
        ],
    )


def write_head_outputs(path: Path, samples: Sequence[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write the head columns of every sample, five digits each."""
    rows = zip(*columns.values(), strict=True)
    write_csv(
        path,
        [
            {"sample_id": sample, **{name: f"{value:.5g}" for name, value in zip(columns, row, strict=True)}}
            for sample, row in zip(samples, rows, strict=True)
        ],
    )


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        RunError: the file is missing or damaged.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"{path}: cannot be read ({error})") from error
    if not isinstance(value, dict):
        raise RunError(f"{path}: holds no JSON object")
    return value


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write a JSON object, indented."""
    write_text(path, json.dumps(value, indent=2) + "\n")
