# SPDX-License-Identifier: Apache-2.0
"""Several methods asked about the same labelled frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from doorstate._jobs import Progress, no_progress
from doorstate.dataset.labelled import LabelledFrame, check_column
from doorstate.errors import DoorstateError
from doorstate.evaluation.frame_metrics import Said, is_wrong, measure
from doorstate.inference.abstention import Abstention
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.types import ABSTAINED, STATES

Methods = Mapping[str, Predictor]


@dataclass(frozen=True, eq=False)
class Asked:
    """Frames that could be read, what each method said of them, and the frames that could not be read."""

    frames: tuple[LabelledFrame, ...]
    predictions: Mapping[str, tuple[Prediction, ...]]  # by method, one a frame
    unreadable: tuple[tuple[LabelledFrame, str], ...]  # with the reason

    def wrong(self, number: int) -> list[str]:
        """Methods that were wrong about a frame, or gave a state where there is none to tell."""
        label = self.frames[number].label
        return [
            name for name, said in self.predictions.items() if is_wrong(label, _said(said[number]).answer)
        ]

    def metrics(self, group: str | None, by: Sequence[str] = ()) -> dict[str, Any]:
        """As of `frame_metrics.measure`.

        Args:
            group: column whose values name what frames depend on, such as a door; None: on nothing.
            by: columns to tell frames apart by; `column:word` tells those apart in which the column has that word.

        Raises:
            ConfigError: no frame has such a column.
        """
        return measure(
            [frame.label for frame in self.frames],
            self._groups(group),
            {name: self._stratum(name) for name in by},
            {name: [_said(each) for each in said] for name, said in self.predictions.items()},
        )

    def rows(self) -> list[dict[str, str]]:
        """One line for each frame and method, with whatever else is known of the frame."""
        return [
            dict(frame.columns)
            | {
                "file": frame.file,
                "state": frame.label,
                "method": method,
                "predicted": _said(said).answer,
                **{f"p_{state}": f"{said.probabilities[state]:.5g}" for state in STATES},
                "p_door": "" if said.door_probability is None else f"{said.door_probability:.5g}",
                "found_angle_deg": "" if said.opening_angle_deg is None else f"{said.opening_angle_deg:.1f}",
                "reason": said.reason,
            }
            for method, predictions in self.predictions.items()
            for frame, said in zip(self.frames, predictions, strict=True)
        ]

    def _groups(self, column: str | None) -> list[str]:
        if column is not None:
            check_column(self.frames, column)
        # A frame of which it is not known is like no other; a column's value is no file's name.
        return [frame.columns.get(column or "") or f"/{frame.file}" for frame in self.frames]

    def _stratum(self, name: str) -> list[str]:
        column, colon, word = name.partition(":")
        check_column(self.frames, column)
        values = [frame.columns.get(column, "") for frame in self.frames]
        if not colon:
            return [value or "not said" for value in values]
        return [word if word.lower() in value.lower() else f"not {word}" for value in values]


def ask(methods: Methods, frames: Sequence[LabelledFrame], progress: Progress = no_progress) -> Asked:
    """Read every frame once and ask every method; a frame that a method cannot use has no answer, with the reason."""
    readable: list[LabelledFrame] = []
    unreadable: list[tuple[LabelledFrame, str]] = []
    predictions: dict[str, list[Prediction]] = {name: [] for name in methods}
    for number, frame in enumerate(frames):
        try:
            cloud = frame.read()
        except DoorstateError as error:
            unreadable.append((frame, error.describe(with_path=False)))
        else:
            readable.append(frame)
            for name, method in methods.items():
                try:
                    said = method(cloud)
                except DoorstateError as error:
                    said = Prediction.abstain(Abstention.from_error(error))
                predictions[name].append(said)
        progress(number + 1, len(frames))
    return Asked(
        tuple(readable), {name: tuple(said) for name, said in predictions.items()}, tuple(unreadable)
    )


def _said(prediction: Prediction) -> Said:
    if prediction.state is None:
        return Said(ABSTAINED, 0.0)
    return Said(prediction.state.label, prediction.probabilities[prediction.state.label])
