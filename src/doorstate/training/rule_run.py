# SPDX-License-Identifier: Apache-2.0
"""One run of a rule: nothing is trained, the test samples of one fold are answered."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.metrics import accuracy_score, f1_score

from doorstate._files import write_csv, write_text
from doorstate._models import FrozenModel
from doorstate.dataset.splits import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import DatasetError
from doorstate.rules import create_rule
from doorstate.rules.base import RuleResult
from doorstate.training.environment import describe_environment
from doorstate.training.run_folder import RunFolder
from doorstate.types import ABSTAINED, NO_DOOR, STATES

_TELL_EVERY_S = 1.0
_OPEN_OR_NOT = ("not_open", "open")


class RuleRunConfig(FrozenModel):
    """What a run answers with; kept in its folder, and a folder is continued only with the same."""

    rule: str
    parameters: dict[str, Any]
    dataset: str
    protocol: str
    fold: int


def answer(
    config: RuleRunConfig, dataset: PreparedDataset, roles: Mapping[str, Role], folder: Path
) -> dict[str, Any]:
    """RuleResult the test samples of a fold from their raw clouds; a finished run is returned as it is.

    Predictions have more columns than a network's: reason, opening_angle_deg, opening_width_m, open_or_not. What was
    found where the answer is not right is kept in `detections.jsonl`, for the report to draw.

    Raises:
        DatasetError: no sample is tested.
        RunError: the folder belongs to another run.
    """
    run = RunFolder(folder)
    run.claim(config.model_dump(mode="json"), describe_environment())
    if run.finished:
        return run.read_metrics()
    tested = [
        sample
        for sample, role in roles.items()
        if role == "test" and dataset.rows[dataset.index_of(sample)]["state"] != NO_DOOR
    ]
    if not tested:
        raise DatasetError(f"no sample with a door is tested in fold {config.fold}")
    rule = create_rule(config.rule)
    started = told = time.perf_counter()
    rows, found, milliseconds = [], [], []
    for done, sample in enumerate(tested):
        index = dataset.index_of(sample)
        cloud = dataset.raw_cloud(index)
        before = time.perf_counter()
        given = rule(cloud)
        milliseconds.append(1000 * (time.perf_counter() - before))
        rows.append(_row(sample, dataset.rows[index]["state"], given))
        if rows[-1]["state"] != rows[-1]["predicted"]:
            shapes = [[shape.name, np.round(shape.points_m, 3).tolist()] for shape in given.detections]
            found.append(json.dumps({"sample_id": sample, "detections": shapes}))
        if time.perf_counter() - told > _TELL_EVERY_S:
            told = time.perf_counter()
            run.write_position((done + 1) / len(tested))
    write_csv(run.predictions, rows)
    write_text(run.detections, "".join(line + "\n" for line in found))
    true, said = [row["state"] for row in rows], [row["predicted"] for row in rows]
    metrics = {
        "method": config.rule,
        "fold": config.fold,
        "seconds": time.perf_counter() - started,
        "test_samples": len(tested),
        "test_macro_f1": float(f1_score(true, said, labels=STATES, average="macro", zero_division=0)),
        "test_accuracy": float(accuracy_score(true, said)),
        "abstained": said.count(ABSTAINED),
        "median_ms": float(np.median(milliseconds)),
        "p95_ms": float(np.quantile(milliseconds, 0.95)),
    }
    run.finish(metrics)
    return metrics


def _row(sample: str, state: str, answer: RuleResult) -> dict[str, str]:
    said = ABSTAINED if answer.state is None else answer.state.label
    return {
        "sample_id": sample,
        "state": state,
        "predicted": said,
        **{f"p_{name}": "1" if name == said else "0" for name in STATES},
        "reason": answer.reason,
        "opening_angle_deg": _number(answer.opening_angle_deg),
        "opening_width_m": _number(answer.opening_width_m),
        "open_or_not": "" if answer.open_or_not is None else _OPEN_OR_NOT[answer.open_or_not],
    }


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
