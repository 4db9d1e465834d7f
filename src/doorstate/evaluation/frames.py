# SPDX-License-Identifier: Apache-2.0
"""Predictions of several methods for the same recorded, labelled frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pandas as pd

from doorstate._jobs import Progress, no_progress
from doorstate.dataset.frame_index import DOOR_COLUMN, MOMENT_COLUMN
from doorstate.dataset.labelled import LabelledFrame, check_column
from doorstate.errors import DoorstateError
from doorstate.evaluation.frame_comparison import FrameComparison, changed_label, compare_methods
from doorstate.evaluation.frame_scores import FrameScores, score_frames
from doorstate.evaluation.labelled_doors import prediction_at
from doorstate.evaluation.manifest import text_values
from doorstate.evaluation.results import TEXT_COLUMNS, join_manifest
from doorstate.inference.abstention import Abstention
from doorstate.inference.posed import predict_posed
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.types import ABSTAINED, STATES, UNKNOWN_STATE

_NO_PROBABILITIES = dict.fromkeys(STATES, math.nan)  # of a rule, and of a cloud that was not evaluated
Predictors = Mapping[str, Predictor]


@dataclass(frozen=True, eq=False)
class FrameResults:
    """Frames that could be read, the predictions of each method for them, and frames that could not be read."""

    frames: tuple[LabelledFrame, ...]
    outputs: Mapping[str, tuple[Prediction, ...]]  # by method, one a frame
    unreadable: tuple[tuple[LabelledFrame, str], ...]  # with the reason

    @cached_property
    def predictions(self) -> pd.DataFrame:
        """One row for each method and frame, with the columns of `Results.predictions`; `sample_id` is the file."""
        rows = [
            {
                "method": method,
                "sample_id": frame.name,
                "state": frame.label,
                "predicted": prediction.label,
                **{
                    f"p_{state}": p
                    for state, p in (prediction.raw_probabilities or _NO_PROBABILITIES).items()
                },
                "p_door": _number(prediction.door_probability),
                "opening_angle_deg": _number(prediction.opening_angle_deg),
                "reason": prediction.reason,
            }
            for method, predictions in self.outputs.items()
            for frame, prediction in zip(self.frames, predictions, strict=True)
        ]
        table = pd.DataFrame(rows)
        return table.astype({name: "str" for name in table if name in TEXT_COLUMNS})

    @cached_property
    def joined(self) -> pd.DataFrame:
        """Predictions joined with the columns of the index, as `Results.joined` is with a manifest.

        On a frame without a clear door an abstention is `correct`; on one of unknown state every answer is.
        """
        index = pd.DataFrame(
            [{**frame.columns, "sample_id": frame.name, "state": ""} for frame in self.frames]
        )
        joined = join_manifest(self.predictions, index.astype("str").set_index("sample_id", drop=False))
        is_door = joined["state"].isin(STATES)
        may_abstain = (joined["predicted"] == ABSTAINED) | (joined["state"] == UNKNOWN_STATE)
        return joined.assign(correct=joined["correct"].where(is_door, may_abstain))

    def misclassified_by(self, number: int) -> list[str]:
        """Return the methods that misclassified a frame, or predicted a state where there is no clear door."""
        rows = self.joined[self.joined["sample_id"] == self.frames[number].name]
        return rows.loc[~rows["correct"], "method"].tolist()

    def score(self, group: str | None = None, by: Sequence[str] = ()) -> FrameScores:
        """Score every method.

        Args:
            group: column of the index by which frames depend on each other, such as a door; None: they do not.
            by: columns to score separately by; `column:word` separates rows in which the column contains the word.

        Raises:
            ConfigError: no frame has such a column.
        """
        for name in (*by, *([group] if group else ())):
            check_column(self.frames, name.partition(":")[0])
        nested = {
            name: (MOMENT_COLUMN, self._groups(MOMENT_COLUMN))
            for name in by
            if name == group and self._has(MOMENT_COLUMN)
        }
        strata = {name: self._stratum(name) for name in by}
        return score_frames(self.joined, self._groups(group), strata, nested)

    def compare(self, group: str | None = None) -> FrameComparison:
        """Compare the methods with the first one, and tell how sure the accuracy is by frames, moments and doors.

        Args:
            group: column of the index by which frames depend on each other; None: they do not.
        """
        columns = [name for name in (MOMENT_COLUMN, DOOR_COLUMN) if self._has(name)]
        columns += [group] if group and group not in columns else []
        units = {"frame": self._groups(None), **{name: self._groups(name) for name in columns}}
        return compare_methods(self.joined, units, group or "frame")

    def change_of(self, number: int) -> str:
        """Return how the last method changes what the first one says of a frame (`changed_label`)."""
        labels = [predictions[number].label for predictions in self.outputs.values()]
        return changed_label(labels[0], labels[-1], self.frames[number].label)

    def _has(self, column: str) -> bool:
        return any(frame.columns.get(column) for frame in self.frames)

    def _groups(self, column: str | None) -> pd.Series[str]:
        """Return the names of a column; a frame without one is a group of its own."""
        file = self.joined["sample_id"]
        names = file if column is None else text_values(self.joined, column)
        return names.where(names != "", "/" + file)  # no value of a column starts as these do

    def _stratum(self, name: str) -> pd.Series[str]:
        column, colon, word = name.partition(":")
        values = text_values(self.joined, column)
        if not colon:
            return values.where(values != "", "unknown")
        contains = values.str.contains(word, case=False, regex=False)
        return contains.map({True: word, False: f"not {word}"})


def default_group(frames: Sequence[LabelledFrame]) -> str | None:
    """Return the column by which frames depend on each other: door, else moment; None if no frame has one of them."""
    names = (DOOR_COLUMN, MOMENT_COLUMN)
    return next((name for name in names if any(frame.columns.get(name) for frame in frames)), None)


def evaluate_frames(
    predictors: Predictors, frames: Sequence[LabelledFrame], progress: Progress = no_progress
) -> FrameResults:
    """Read every file once and predict its state with every method, at the place of each labelled door.

    A method abstains from a frame that it cannot use, with the error as its reason.
    """
    readable: list[LabelledFrame] = []
    unreadable: list[tuple[LabelledFrame, str]] = []
    outputs: dict[str, list[Prediction]] = {name: [] for name in predictors}
    last: tuple[Path, str] | None = None
    predictions: dict[str, Prediction] | str = ""  # of the last file, or why there are none
    for number, frame in enumerate(frames):
        if (frame.folder, frame.file) != last:
            last, predictions = (frame.folder, frame.file), _predict(predictors, frame)
        if isinstance(predictions, str):
            unreadable.append((frame, predictions))
        else:
            readable.append(frame)
            for name, prediction in predictions.items():
                outputs[name].append(prediction_at(prediction, frame.doorway))
        progress(number + 1, len(frames))
    return FrameResults(
        tuple(readable),
        {name: tuple(predictions) for name, predictions in outputs.items()},
        tuple(unreadable),
    )


def _predict(predictors: Predictors, frame: LabelledFrame) -> dict[str, Prediction] | str:
    """Return the prediction of each method for a file, or the reason why it cannot be read."""
    try:
        cloud = frame.read()
    except DoorstateError as error:
        return error.describe(with_path=False)
    predictions = {}
    for name, predictor in predictors.items():
        try:
            predictions[name] = predict_posed(predictor, *cloud)
        except DoorstateError as error:
            predictions[name] = Prediction.abstain(Abstention.from_error(error))
    return predictions


def _number(value: float | None) -> float:
    return math.nan if value is None else value
