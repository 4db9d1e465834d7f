# SPDX-License-Identifier: Apache-2.0
"""Files of one run. `metrics.json` is written last and marks a finished run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from doorstate._documents import read_json
from doorstate._files import read_csv, write_csv, write_text
from doorstate._input import MAX_SETTINGS_BYTES, read_input_text
from doorstate.errors import RunError
from doorstate.types import STATES

AS_TRAINED, FINE_TUNED = "as-trained", "fine-tuned"  # comparisons of a resolution study are named KIND-POINTS


class RunFolder:
    """Paths of the files of one run, and functions to read and write the small ones."""

    def __init__(self, path: Path) -> None:
        """Name the files; nothing is read or made."""
        self.path = path
        self.config = path / "config.json"
        self.environment = path / "environment.json"
        self.log = path / "log.csv"
        self.position = path / "position.txt"
        self.checkpoint = path / "checkpoint.pt"
        self.weights = path / "weights.safetensors"
        self.predictions = path / "predictions.csv"
        self.validation = path / "validation.csv"  # predictions for the samples that the epoch was chosen on
        self.head_outputs = path / "head_outputs.csv"  # of further heads, for all test samples
        self.validation_heads = path / "validation_heads.csv"  # of further heads, for all validation samples
        self.detections = path / "detections.jsonl"  # of a rule, for the test samples that it got wrong
        self.metrics = path / "metrics.json"

    @property
    def finished(self) -> bool:
        """True once the run has been tested."""
        return self.metrics.is_file()

    def claim(self, config: Mapping[str, Any], environment: Mapping[str, Any]) -> None:
        """Start the run, or check that the folder holds the same run.

        Raises:
            RunError: the folder holds another run.
        """
        if self.config.is_file():
            check_same_settings(self.config, config)
        else:
            write_json(self.config, config)
        if not self.finished:
            write_json(self.environment, environment)

    def write_position(self, epochs: float) -> None:
        """Write the position of the training, in epochs, for progress displays."""
        write_text(self.position, f"{epochs:.3f}\n", durable=False)

    def read_position(self) -> float:
        """Return the position of the training, in epochs; 0 before it is written."""
        try:
            return float(read_input_text(self.position, MAX_SETTINGS_BYTES, RunError))
        except (RunError, ValueError):
            return 0.0

    def read_metrics(self) -> dict[str, Any]:
        """Return the metrics of a finished run.

        Raises:
            RunError: the run is not finished.
        """
        return read_json(self.metrics)

    def write_log(self, entries: Sequence[Mapping[str, float]]) -> None:
        """Write one line per epoch."""
        write_csv(self.log, [{key: f"{value:.6g}" for key, value in entry.items()} for entry in entries])

    def read_log(self) -> list[dict[str, str]]:
        """Return one entry per finished epoch."""
        return read_csv(self.log) if self.log.is_file() else []

    def finish(self, metrics: Mapping[str, Any]) -> None:
        """Write the metrics and delete the files that only an unfinished run needs."""
        write_json(self.metrics, metrics)
        self.checkpoint.unlink(missing_ok=True)
        self.position.unlink(missing_ok=True)


def run_of(folder: Path, method: str, fold: int) -> RunFolder:
    """Return the run of a network or rule on one fold in the folder of a comparison."""
    return RunFolder(folder / "runs" / method / f"fold{fold}")


def check_same_settings(path: Path, settings: Mapping[str, Any]) -> None:
    """Raise RunError unless a JSON file holds these settings."""
    stored = read_json(path)
    changed = sorted(key for key in {*stored, *settings} if stored.get(key) != settings.get(key))
    if changed:
        raise RunError(
            f"the folder was made with another {', '.join(changed)}",
            path=path.parent,
            field=changed[0],
            hint="choose another folder",
        )


def write_predictions(
    path: Path, samples: Sequence[str], labels: np.ndarray, probabilities: np.ndarray
) -> None:
    """Write states and probabilities.

    Args:
        path: a CSV file.
        samples: names of M samples.
        labels: (M,) true states.
        probabilities: (M, 3); five digits, because temperature scaling takes logarithms of small ones.
    """
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


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write a JSON object, indented."""
    write_text(path, json.dumps(value, indent=2) + "\n")
