# SPDX-License-Identifier: Apache-2.0
"""One run of a rule: the test samples of one fold; nothing is trained."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from sklearn.metrics import accuracy_score, f1_score

from doorstate._environment import describe_environment
from doorstate._files import write_csv, write_text
from doorstate._locks import owned_folder
from doorstate._models import FrozenModel, Name
from doorstate.dataset.roles import Role
from doorstate.dataset.splits import NUM_FOLDS
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import DatasetError
from doorstate.rules import create_rule
from doorstate.rules.base import RuleResult
from doorstate.training.contents import contents_of_run, keep_contents
from doorstate.training.run_folder import RunFolder
from doorstate.types import ABSTAINED, STATES

_POSITION_INTERVAL_S = 1.0
_OPEN_OR_NOT = ("not_open", "open")


class RuleRunConfig(FrozenModel):
    """Configuration of a run, stored in its folder; a folder is continued only with the same configuration."""

    rule: Name
    parameters: dict[str, Any]
    dataset: str
    protocol: str
    fold: int = Field(ge=0, lt=NUM_FOLDS)


def run_rule(
    config: RuleRunConfig, dataset: PreparedDataset, roles: Mapping[str, Role], folder: Path
) -> dict[str, Any]:
    """Apply a rule to the raw clouds of the test samples with a state; a finished run is returned.

    Predictions have more columns than those of a network: reason, opening_angle_deg, opening_width_m, open_or_not.
    Detections in the samples that the rule got wrong are kept in `detections.jsonl`, for the report.

    Args:
        config: configuration of the run.
        dataset: data set of the run.
        roles: {sample_id: role} of the fold.
        folder: folder of the run.

    Returns:
        Metrics as in `metrics.json`.

    Raises:
        DatasetError: there is no test sample with a state.
        RunError: the folder holds another run, or began with other data.
        FolderInUseError: another process works in the folder.
    """
    with owned_folder(folder):
        return _apply(config, dataset, roles, RunFolder(folder))


def _apply(
    config: RuleRunConfig, dataset: PreparedDataset, roles: Mapping[str, Role], run: RunFolder
) -> dict[str, Any]:
    run.claim(config.model_dump(mode="json"), describe_environment())
    keep_contents(run.path, contents_of_run(dataset.folder, roles))
    if run.finished:
        return run.read_metrics()
    samples = _test_samples(dataset, roles)
    if not samples:
        raise DatasetError(
            f"no test sample with a state of a door in fold {config.fold}", path=dataset.folder
        )
    rule = create_rule(config.rule)
    started = position_s = time.perf_counter()
    rows, detections, milliseconds = [], [], []
    for number, sample in enumerate(samples, start=1):
        index = dataset.index_of(sample)
        cloud = dataset.raw_cloud(index)
        rule_started = time.perf_counter()
        result = rule(cloud)
        milliseconds.append(1000 * (time.perf_counter() - rule_started))
        row = _prediction_row(sample, dataset.rows[index]["state"], result)
        rows.append(row)
        if row["state"] != row["predicted"]:
            detections.append(_detections_line(sample, result))
        if time.perf_counter() - position_s > _POSITION_INTERVAL_S:
            position_s = time.perf_counter()
            run.write_position(number / len(samples))
    write_csv(run.predictions, rows)
    write_text(run.detections, "".join(line + "\n" for line in detections))
    metrics = {
        "method": config.rule,
        "fold": config.fold,
        "seconds": time.perf_counter() - started,
        "test_samples": len(samples),
        **_scores(rows),
        "median_ms": float(np.median(milliseconds)),
        "p95_ms": float(np.quantile(milliseconds, 0.95)),
    }
    keep_contents(run.path, contents_of_run(dataset.folder, roles))
    run.finish(metrics)
    return metrics


def _test_samples(dataset: PreparedDataset, roles: Mapping[str, Role]) -> list[str]:
    return [
        sample
        for sample, role in roles.items()
        if role == "test" and dataset.rows[dataset.index_of(sample)]["state"] in STATES
    ]


def _scores(rows: Sequence[Mapping[str, str]]) -> dict[str, float]:
    true, predicted = [row["state"] for row in rows], [row["predicted"] for row in rows]
    return {
        "test_macro_f1": float(f1_score(true, predicted, labels=STATES, average="macro", zero_division=0)),
        "test_accuracy": float(accuracy_score(true, predicted)),
        "abstained": predicted.count(ABSTAINED),
    }


def _prediction_row(sample: str, state: str, result: RuleResult) -> dict[str, str]:
    predicted = ABSTAINED if result.state is None else str(result.state)
    return {
        "sample_id": sample,
        "state": state,
        "predicted": predicted,
        **{f"p_{name}": "" for name in STATES},  # a rule estimates none
        "reason": result.reason,
        "opening_angle_deg": _number(result.opening_angle_deg),
        "opening_width_m": _number(result.opening_width_m),
        "open_or_not": "" if result.open_or_not is None else _OPEN_OR_NOT[result.open_or_not],
    }


def _detections_line(sample: str, result: RuleResult) -> str:
    detections = [
        [detection.name, np.round(detection.points_m, 3).tolist()] for detection in result.detections
    ]
    return json.dumps({"sample_id": sample, "detections": detections})


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
