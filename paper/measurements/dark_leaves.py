# SPDX-License-Identifier: Apache-2.0
"""Answers for doors whose leaf was not measured, as of black and glossy leaves, and for open doors that were."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from doorstate._jobs import Progress
from doorstate.clouds.measured import is_measured
from doorstate.evaluation.table import Table
from doorstate.inference.prediction import Prediction
from doorstate.simulation.frames import Frame
from doorstate.simulation.presets import PresetName
from doorstate.simulation.row import Row
from doorstate.types import Part, Points

from .frames import reference_frames, scene_frames
from .methods import all_methods

_SOURCES: tuple[tuple[PresetName, str], ...] = (
    ("ogurob", "none"),
    ("varied", "d435"),
    ("varied", "d435"),
    ("varied", "xtion"),
    ("cluttered", "kinect"),
)
_AFTER = "opening_not_seen"  # reason of the check after a network or rule


class DarkResult(NamedTuple):
    """Answer of one method for one cloud."""

    method: str
    cloud: str  # "image" or "flat"
    state: str
    is_dark: bool  # its leaf was removed
    answer: str  # a state, "gate", "floor" or "abstained"


def dark_leaf(frame: Frame) -> Points:
    """Return the cloud without the points of the leaf, as of black and glossy leaves."""
    cloud = frame.points.copy()
    cloud[frame.cut.part == Part.LEAF] = np.nan
    return cloud


def measure_dark_leaves(network: str, count: int, progress: Progress) -> list[DarkResult]:
    """Return the answers of packaged weights and all rules: closed and semi-open doors dark, open ones as they are."""
    methods = all_methods(network)
    results = []
    for row, frame in _frames(count, progress):
        is_dark = row.state != "open"
        image = dark_leaf(frame) if is_dark else frame.points
        for form, cloud in (("image", image), ("flat", image[is_measured(image)])):
            for name, predictor in methods.items():
                results.append(DarkResult(name, form, row.state, is_dark, _answer(predictor(cloud))))
    return results


def _frames(count: int, progress: Progress) -> Iterator[tuple[Row, Frame]]:
    share = -(-count // len(_SOURCES))
    for number, (preset, sensor) in enumerate(_SOURCES):

        def report(done: int, _: int, start: int = number * share) -> None:
            progress(start + done, len(_SOURCES) * share)

        if preset == "ogurob":
            yield from reference_frames(share, report)
        else:
            first = share * _SOURCES[:number].count((preset, sensor))
            yield from scene_frames(share, sensor, report, preset, first)
    progress(len(_SOURCES) * share, len(_SOURCES) * share)


def _answer(prediction: Prediction) -> str:
    if prediction.abstention is None:
        return prediction.label
    if prediction.abstention.code == _AFTER:
        return "floor"
    evaluated = prediction.raw_probabilities is not None or prediction.abstention.code == "no_rule_result"
    return "abstained" if evaluated else "gate"


def dark_table(results: Sequence[DarkResult]) -> Table:
    """Return one row per method and form of cloud."""
    rows = []
    for method, form in dict.fromkeys((result.method, result.cloud) for result in results):
        cells = [method, form]
        for state in ("closed", "semi_open", "open"):
            answers = Counter(
                result.answer
                for result in results
                if (result.method, result.cloud, result.state) == (method, form, state)
            )
            cells += [str(answers.total()), str(answers["gate"]), str(answers["floor"]), str(answers["open"])]
        rows.append(tuple(cells))
    columns = ("doors", "refused by the gate", "by the floor behind", "open")
    return Table(
        "Dark leaves",
        (
            "method",
            "cloud",
            *(f"{kind}: {column}" for kind in ("closed", "semi-open", "open") for column in columns),
        ),
        tuple(rows),
        "Closed and semi-open doors whose leaf was not measured at all, and open doors as they are, in simulated rooms "
        "without noise and as `d435`, `xtion` and `kinect` measure them. *By the floor behind*: called open, and then "
        "refused because the rays to the floor behind the opening did not come back. The other doors are given other "
        "states or none.",
        text_columns=2,
    )
