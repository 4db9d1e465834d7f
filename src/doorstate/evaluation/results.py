# SPDX-License-Identifier: Apache-2.0
"""Results of a comparison: its configuration, splits and runs, and one table of all predictions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import BaseModel, ConfigDict, Field

from doorstate._models import Name
from doorstate.dataset.roles import Role
from doorstate.rules.base import Detection
from doorstate.types import STATES

PROBABILITY_COLUMNS = tuple(f"p_{state}" for state in STATES)
TEXT_COLUMNS = ("part", "method", "role", "sample_id", "state", "predicted", "reason", "open_or_not")
KEY_COLUMNS = ("method", "fold", "role", "sample_id", "state", "predicted", *PROBABILITY_COLUMNS)
RULE_COLUMNS = ("reason", "opening_angle_deg", "open_or_not")
"""Columns of every table of predictions; those of heads follow where a method has them."""


class ComparisonConfig(BaseModel):
    """Resolved configuration of a comparison; fields that evaluation does not use are kept as they were read."""

    model_config = ConfigDict(frozen=True, extra="allow")

    name: Name
    dataset: str
    protocol: str
    networks: tuple[Name, ...]
    rules: tuple[Name, ...] = ()
    folds: int = Field(ge=0, le=100)
    num_points: int
    seed: int
    recipe: Mapping[str, Any] = {}
    runs: Mapping[str, Mapping[str, Any]] = {}  # by method: settings of its runs, without the fold

    @property
    def methods(self) -> tuple[str, ...]:
        """Networks, then rules."""
        return self.networks + self.rules


@dataclass(frozen=True, eq=False)
class RunRecord:
    """Metrics, environment and epoch log of one run; empty where the run did not record them."""

    method: str
    fold: int
    metrics: Mapping[str, Any] = field(default_factory=dict)
    environment: Mapping[str, Any] = field(default_factory=dict)
    log: pd.DataFrame = field(default_factory=pd.DataFrame)  # one row an epoch

    def metric(self, name: str) -> float:
        """Return a number of `metrics`, NaN where the run did not record it."""
        value = self.metrics.get(name)
        return float(value) if isinstance(value, int | float) else float("nan")


@dataclass(frozen=True, eq=False)
class Results:
    """Finished runs of a comparison, in the order of its methods and folds.

    `predictions` has one row for each method, fold, role (test, val) and sample. A sample without a door, or with a
    door of unknown state, has a row where a network has further heads; its `predicted` and its probabilities of states
    are missing. So are the probabilities of rules.
    """

    config: ComparisonConfig
    dataset_folder: Path
    manifest: pd.DataFrame  # as `read_manifest` returns it
    splits: tuple[Mapping[str, Role], ...]  # by fold, role of every sample
    predictions: pd.DataFrame
    runs: tuple[RunRecord, ...]
    detections: Mapping[str, Mapping[str, tuple[Detection, ...]]] = field(default_factory=dict)
    """Detections in the samples that a rule did not get right, by rule and sample."""

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """Networks and rules with at least one finished run."""
        finished = {run.method for run in self.runs}
        return tuple(method for method in self.config.methods if method in finished)

    @property
    def networks(self) -> tuple[str, ...]:
        """Networks with at least one finished run."""
        return tuple(method for method in self.methods if method in self.config.networks)

    @property
    def rules(self) -> tuple[str, ...]:
        """Rules with at least one finished run."""
        return tuple(method for method in self.methods if method in self.config.rules)

    @property
    def missing(self) -> tuple[tuple[str, int], ...]:
        """Pairs (method, fold) of the configuration that have no predictions."""
        finished = {(run.method, run.fold) for run in self.runs}
        planned = ((method, fold) for method in self.config.methods for fold in range(self.config.folds))
        return tuple(pair for pair in planned if pair not in finished)

    def runs_of(self, method: str) -> tuple[RunRecord, ...]:
        """Return the finished runs of a method by fold."""
        return tuple(run for run in self.runs if run.method == method)

    def role_counts(self, fold: int) -> Counter[str]:
        """Return the number of samples in each role of a fold."""
        return Counter(self.splits[fold].values())

    @cached_property
    def joined(self) -> pd.DataFrame:
        """Predictions joined with their manifest; predicted values of a manifest's columns end in `_predicted`.

        Column `correct` tells whether the predicted state is the true one.
        """
        return join_manifest(self.predictions, self.manifest)

    @cached_property
    def tested(self) -> pd.DataFrame:
        """Rows of `joined` with a state that were tested; pooled over folds, every sample at most once a method."""
        return self.joined[(self.joined["role"] == "test") & self.joined["state"].isin(STATES)]

    def tested_by(self, method: str) -> pd.DataFrame:
        """Return the rows of `tested` of a method."""
        return self._tested_by_method[method]

    @cached_property
    def _tested_by_method(self) -> dict[str, pd.DataFrame]:
        by_method = {str(method): rows for method, rows in self.tested.groupby("method", sort=False)}
        return {method: by_method.get(method, self.tested.iloc[:0]) for method in self.methods}

    @cached_property
    def errors(self) -> pd.DataFrame:
        """Rows of `tested` whose state was not predicted, with the probability (`confidence`) of the wrong state.

        The confidence of an abstention is 0, that of a rule's state NaN.
        """
        errors = self.tested[~self.tested["correct"]]
        confidence = sum(
            (errors[f"p_{state}"].where(errors["predicted"] == state, 0.0) for state in STATES),
            start=pd.Series(0.0, errors.index),
        )
        return errors.assign(confidence=confidence)


def predicted_column(name: str) -> str:
    """Return the column of `Results.joined` with the predicted value of a manifest's column."""
    return f"{name}_predicted"


def join_manifest(predictions: pd.DataFrame, manifest: pd.DataFrame) -> pd.DataFrame:
    """Join predictions with a manifest indexed by `sample_id`, as `Results.joined` describes."""
    measured = [
        column
        for column in predictions.columns
        if column not in TEXT_COLUMNS and column != "fold" and not column.startswith("p_")
    ]
    renamed = predictions.rename(columns={column: predicted_column(column) for column in measured})
    # Predictions win where a manifest has a column of the same name.
    truth = manifest.drop(columns=[name for name in manifest if name in renamed])
    joined = renamed.join(truth, on="sample_id")
    return joined.assign(correct=joined["predicted"] == joined["state"])


def order_predictions(predictions: pd.DataFrame, config: ComparisonConfig) -> pd.DataFrame:
    """Sort rows by method, fold and role, samples as they were, and put the columns that all tables have first.

    A rule estimates no probabilities; tables of doorstate 0.1 have 1 for its state.
    """
    is_rule = predictions["method"].isin(config.rules)
    no_probabilities = {name: predictions[name].mask(is_rule) for name in PROBABILITY_COLUMNS}
    predictions = predictions.assign(**no_probabilities)
    rank = pd.DataFrame(
        {
            "method": predictions["method"].map({name: rank for rank, name in enumerate(config.methods)}),
            "fold": predictions["fold"],
            "role": predictions["role"],
        }
    )
    rows = predictions.loc[rank.sort_values(["method", "fold", "role"], kind="stable").index]
    first = (*KEY_COLUMNS, *RULE_COLUMNS)
    columns = [*first, *(name for name in predictions if name not in first)]
    text = {name: "str" for name in columns if name in TEXT_COLUMNS}
    return (
        rows.reindex(columns=columns).astype({**text, "opening_angle_deg": "float64"}).reset_index(drop=True)
    )
