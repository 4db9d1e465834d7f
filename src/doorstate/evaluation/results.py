# SPDX-License-Identifier: Apache-2.0
"""A finished or partly finished comparison as one checked value, read from its folder, never recomputed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from doorstate._files import read_csv
from doorstate.dataset.splits import Role, read_splits
from doorstate.dataset.store import MANIFEST
from doorstate.errors import DatasetError, RunError, first_validation_error
from doorstate.evaluation.detections import Detections, read_detections
from doorstate.evaluation.metrics import Floats
from doorstate.rules.base import Detection
from doorstate.training.run_folder import RunFolder, read_json, run_of
from doorstate.types import NO_DOOR, PREDICTED_LABELS, STATES, Indices

PROBABILITY_COLUMNS = tuple(f"p_{state}" for state in STATES)


@dataclass(frozen=True)
class Comparison:
    """What was asked for: the content of `comparison.json`."""

    name: str
    dataset: str
    protocol: str
    networks: tuple[str, ...]
    folds: int
    num_points: int
    seed: int
    recipe: Mapping[str, Any] = field(default_factory=dict)
    rules: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """Networks and rules."""
        return self.networks + self.rules


@dataclass(frozen=True, eq=False)
class Predictions:
    """Answers to N test samples: labels, 3 where there is no answer, and probabilities in the order of `STATES`."""

    sample_ids: tuple[str, ...]
    folds: Indices  # (N,) the fold in which a sample was tested
    true: Indices  # (N,)
    predicted: Indices  # (N,)
    probabilities: Floats  # (N, 3)
    angles_deg: Floats  # (N,) opening angles a rule gave, NaN where it gave none
    reasons: tuple[str, ...] = ()  # N reasons for no answer, or none at all
    open_or_not: tuple[
        str, ...
    ] = ()  # N, of rules that tell `open` from `not_open` and no more; or none at all

    @property
    def right(self) -> NDArray[np.bool_]:
        """(N,) whether the answer is the true state."""
        return np.equal(self.true, self.predicted)

    @property
    def right_by_sample(self) -> dict[str, bool]:
        """Whether the answer is the true state, by sample."""
        return dict(zip(self.sample_ids, self.right.tolist(), strict=True))

    def __len__(self) -> int:
        return len(self.sample_ids)


@dataclass(frozen=True, eq=False)
class Answers:
    """What further heads say of N test samples, in metres and degrees, by the manifest's name of it."""

    sample_ids: tuple[str, ...]
    columns: Mapping[str, Floats]  # (N,) each; probabilities are `p_door` and `p_hinge_left`


@dataclass(frozen=True, eq=False)
class Run:
    """One network trained and tested on one fold; whatever the run did not write is empty."""

    network: str
    fold: int
    predictions: Predictions
    metrics: Mapping[str, Any]
    log: Mapping[str, Floats]
    environment: Mapping[str, Any]
    validation: Predictions | None = None
    answers: Answers | None = None  # of further heads, to all test samples, those without a door too
    detections: Detections = field(default_factory=dict)  # of a rule, where it was wrong

    def metric(self, name: str) -> float:
        """A number of `metrics.json`, NaN where the run did not record it."""
        value = self.metrics.get(name)
        return float(value) if isinstance(value, int | float) else float("nan")


@dataclass(frozen=True)
class ErrorRow:
    """One misclassified sample of one network."""

    network: str
    fold: int
    sample_id: str
    state: str
    predicted: str
    probabilities: tuple[float, ...]

    @property
    def confidence(self) -> float:
        """Probability given to the wrong answer; 0 where there is none."""
        return self.probabilities[STATES.index(self.predicted)] if self.predicted in STATES else 0.0


@dataclass(frozen=True, eq=False)
class ComparisonResults:
    """All runs found in a comparison folder, in the order of the comparison's networks and folds."""

    comparison: Comparison
    dataset_folder: Path
    splits: tuple[Mapping[str, Role], ...]  # for each fold, the role of every sample
    runs: tuple[Run, ...]

    @property
    def networks(self) -> tuple[str, ...]:
        """Networks and rules with at least one finished run."""
        finished = {run.network for run in self.runs}
        return tuple(network for network in self.comparison.methods if network in finished)

    @property
    def missing(self) -> tuple[tuple[str, int], ...]:
        """Pairs (network, fold) that were asked for and have no predictions."""
        finished = {(run.network, run.fold) for run in self.runs}
        asked = ((name, fold) for name in self.comparison.methods for fold in range(self.comparison.folds))
        return tuple(pair for pair in asked if pair not in finished)

    def runs_of(self, network: str) -> tuple[Run, ...]:
        """Finished runs of one network by fold."""
        return tuple(run for run in self.runs if run.network == network)

    def pooled(self, network: str) -> Predictions:
        """Join the test samples of all folds of one network (the paper's "cumulative" results)."""
        parts = [run.predictions for run in self.runs_of(network)]
        return Predictions(
            tuple(sample_id for part in parts for sample_id in part.sample_ids),
            np.concatenate([part.folds for part in parts]),
            np.concatenate([part.true for part in parts]),
            np.concatenate([part.predicted for part in parts]),
            np.concatenate([part.probabilities for part in parts]),
            np.concatenate([part.angles_deg for part in parts]),
            tuple(reason for part in parts for reason in part.reasons),
            tuple(answer for part in parts for answer in part.open_or_not),
        )

    def answers(self, network: str) -> Answers | None:
        """Join what further heads of one network say in all folds; None if it has none."""
        parts = [run.answers for run in self.runs_of(network)]
        given = [part for part in parts if part is not None]
        if not given or len(given) < len(parts):
            return None
        return Answers(
            tuple(sample_id for part in given for sample_id in part.sample_ids),
            {name: np.concatenate([part.columns[name] for part in given]) for name in given[0].columns},
        )

    def shapes(self, network: str, sample_id: str) -> tuple[Detection, ...]:
        """What a rule found in a sample; nothing of a network, or where the answer was right."""
        return tuple(shape for run in self.runs_of(network) for shape in run.detections.get(sample_id, ()))

    def role_counts(self, fold: int) -> Counter[str]:
        """Number of samples in each role of one fold."""
        return Counter(self.splits[fold].values())

    @property
    def error_rows(self) -> tuple[ErrorRow, ...]:
        """Every misclassified sample of every network."""
        return tuple(
            ErrorRow(
                run.network,
                run.fold,
                run.predictions.sample_ids[i],
                STATES[run.predictions.true[i]],
                PREDICTED_LABELS[run.predictions.predicted[i]],
                tuple(run.predictions.probabilities[i].tolist()),
            )
            for run in self.runs
            for i in np.flatnonzero(~run.predictions.right)
        )


def load_results(
    comparison_folder: Path, dataset_folder: Path | None = None, folds: int | None = None
) -> ComparisonResults:
    """Read a comparison folder; runs without predictions are listed in `missing`, everything else must fit.

    Args:
        comparison_folder: holds `comparison.json`, `splits.csv` and `runs/<network>/fold<k>/`.
        dataset_folder: its data set, if it is not where the comparison says.
        folds: read the first so many folds only, as if no more had been asked for.

    Raises:
        RunError: no run is finished, a file is missing or damaged, a network tested a sample twice, or a
            state or a test set differs from the manifest of the data set or from the splits.
    """
    comparison = _read_comparison(comparison_folder / "comparison.json")
    comparison = replace(comparison, folds=min(comparison.folds, folds or comparison.folds))
    splits = read_splits(comparison_folder / "splits.csv")
    if len(splits) < comparison.folds:
        raise RunError(f"{comparison_folder / 'splits.csv'}: {len(splits)} folds, not {comparison.folds}")
    dataset_folder = dataset_folder or _find_dataset(comparison_folder, comparison.dataset)
    manifest = _read_columns(dataset_folder / MANIFEST, ("sample_id", "state"))
    states = {row["sample_id"]: row["state"] for row in manifest}
    runs = []
    for network in comparison.methods:
        tested: dict[str, int] = {}
        for fold in range(comparison.folds):
            folder = run_of(comparison_folder, network, fold)
            if folder.predictions.exists():
                run = _read_run(folder, network, fold)
                _check_run(run, folder.predictions, splits[fold], states, tested)
                runs.append(run)
    if not runs:
        raise RunError(f"{comparison_folder}: no run has predictions yet; train at least one network first")
    return ComparisonResults(comparison, dataset_folder, tuple(splits), tuple(runs))


def _read_comparison(path: Path) -> Comparison:
    try:
        return TypeAdapter(Comparison).validate_python(read_json(path))
    except ValidationError as error:
        raise RunError(f"{path}: {first_validation_error(error)}; write the comparison again") from error


def _find_dataset(comparison_folder: Path, dataset: str) -> Path:
    for folder in (Path(dataset), comparison_folder / dataset):
        if (folder / MANIFEST).exists():
            return folder
    raise RunError(f"{comparison_folder / 'comparison.json'}: no {MANIFEST} in its data set {dataset}")


def _read_run(folder: RunFolder, network: str, fold: int) -> Run:
    predictions = _read_predictions(folder.predictions, fold)
    answers = _read_answers(folder.head_outputs) if folder.head_outputs.exists() else None
    if answers is not None and "opening_angle_deg" in answers.columns:
        said = dict(zip(answers.sample_ids, answers.columns["opening_angle_deg"].tolist(), strict=True))
        angles_deg = np.array([said.get(sample_id, math.nan) for sample_id in predictions.sample_ids])
        predictions = replace(predictions, angles_deg=angles_deg)
    return Run(
        network,
        fold,
        predictions,
        read_json(folder.metrics) if folder.metrics.exists() else {},
        _read_log(folder.log) if folder.log.exists() else {},
        read_json(folder.environment) if folder.environment.exists() else {},
        _read_predictions(folder.validation, fold) if folder.validation.exists() else None,
        answers,
        read_detections(folder.detections),
    )


def _read_predictions(path: Path, fold: int) -> Predictions:
    rows = _read_columns(path, ("sample_id", "state", "predicted", *PROBABILITY_COLUMNS))
    named = [(row["state"], row["predicted"]) for row in rows]
    unknown = {state for state, _ in named} - set(STATES) | {answer for _, answer in named} - set(
        PREDICTED_LABELS
    )
    if unknown:
        raise RunError(f"{path}: {sorted(unknown)[0]!r} is none of {', '.join(STATES)}; test this run again")
    labels = np.array([[PREDICTED_LABELS.index(name) for name in pair] for pair in named], dtype=np.int64)
    true, predicted = labels.reshape(-1, 2).T
    try:
        cells = [[float(row[column]) for column in PROBABILITY_COLUMNS] for row in rows]
        angles_deg = np.array(
            [float(row.get("opening_angle_deg") or "nan") for row in rows], dtype=np.float64
        )
    except ValueError as error:
        raise RunError(f"{path}: {error}; test this run again") from error
    probabilities = np.array(cells, dtype=np.float64).reshape(len(rows), len(STATES))
    if not np.isfinite(probabilities).all():
        raise RunError(f"{path}: a probability is not finite; train this run again")
    sample_ids = tuple(row["sample_id"] for row in rows)
    reasons = tuple(row["reason"] for row in rows if "reason" in row)
    told = tuple(row["open_or_not"] for row in rows if "open_or_not" in row)
    return Predictions(
        sample_ids, np.full(len(rows), fold), true, predicted, probabilities, angles_deg, reasons, told
    )


def _read_answers(path: Path) -> Answers:
    rows = _read_columns(path, ("sample_id",))
    names = [name for name in (rows[0] if rows else {}) if name != "sample_id"]
    try:
        columns = {name: np.array([float(row[name]) for row in rows], dtype=np.float64) for name in names}
    except ValueError as error:
        raise RunError(f"{path}: {error}; test this run again") from error
    return Answers(tuple(row["sample_id"] for row in rows), columns)


def _read_log(path: Path) -> dict[str, Floats]:
    rows = _read_columns(path, ("epoch",))
    try:
        return {
            name: np.array([float(row[name] or "nan") for row in rows], dtype=np.float64)
            for name in (rows[0] if rows else ())
        }
    except ValueError as error:
        raise RunError(f"{path}: {error}; delete the file or train this run again") from error


def _check_run(
    run: Run,
    path: Path,
    roles: Mapping[str, Role],
    states: Mapping[str, str],
    tested: dict[str, int],
) -> None:
    """Compare a run with its fold, the manifest, and the earlier folds in `tested`, to which it is added."""
    for sample_id, label in zip(run.predictions.sample_ids, run.predictions.true, strict=True):
        if sample_id in tested:
            raise RunError(f"{path}: sample {sample_id} was already tested in fold {tested[sample_id]}")
        tested[sample_id] = run.fold
        if roles.get(sample_id) != "test":
            raise RunError(f"{path}: sample {sample_id} is no test sample of fold {run.fold} in splits.csv")
        if states.get(sample_id) != STATES[label]:
            raise RunError(
                f"{path}: sample {sample_id} is {STATES[label]} here and {states.get(sample_id, 'absent')} in"
                " the data set's manifest.csv; use the data set of this comparison"
            )
    expected = sum(role == "test" and states.get(sample_id) != NO_DOOR for sample_id, role in roles.items())
    if len(run.predictions) != expected:
        raise RunError(
            f"{path}: {len(run.predictions)} of {expected} test samples of fold {run.fold}; test it again"
        )


def _read_columns(path: Path, required: Sequence[str]) -> list[dict[str, str]]:
    try:
        rows = read_csv(path)
    except DatasetError as error:
        raise RunError(f"{error}; write it again") from error
    if absent := [name for name in required if rows and name not in rows[0]]:
        raise RunError(f"{path}: column {absent[0]} is missing; write the file again")
    return rows
