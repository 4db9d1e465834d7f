# SPDX-License-Identifier: Apache-2.0
"""Answers for the frames that Gazebo rendered, when their camera is tilted."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import pandas as pd

from doorstate._jobs import Progress
from doorstate.evaluation.table import Table, count_column, label_column, text_column
from doorstate.inference.predictor import Predictor

from ..answers import gazebo_frames, gazebo_heights_m
from .leveling import tilted
from .words import count_words

TILTS: tuple[tuple[float, float], ...] = (
    (0, 0),
    *((0, pitch) for pitch in (10, 20, 30)),
    *((roll, 0) for roll in (10, 20, 30)),
)
"""Roll and pitch in degrees: the camera looks down, or is turned clockwise about its axis."""


class TiltedAnswer(NamedTuple):
    """Answer for one frame with one tilt."""

    frame: int
    roll_deg: float
    pitch_deg: float
    is_height_known: bool  # of the camera
    state: str
    predicted: str | None
    reason: str  # code; empty with a state


def measure_tilted_answers(predictor: Predictor, progress: Progress) -> list[TiltedAnswer]:
    """Return the answers for all frames with all tilts, which the predictor is not told."""
    answers = []
    frames = list(zip(gazebo_frames(), gazebo_heights_m(), strict=True))
    for number, ((state, level), height_m) in enumerate(frames):
        for (roll_deg, pitch_deg), is_height_known in product(TILTS, (False, True)):
            cloud = tilted(level, roll_deg, pitch_deg, None).points
            prediction = predictor(cloud, camera_height_m=height_m if is_height_known else None)
            reason = "" if prediction.abstention is None else prediction.abstention.code
            answers.append(
                TiltedAnswer(number, roll_deg, pitch_deg, is_height_known, state, prediction.state, reason)
            )
        progress(number + 1, len(frames))
    return answers


def tilted_answers_table(answers: Sequence[TiltedAnswer]) -> Table:
    """Return one row per tilt, with and without the height of the camera."""
    level = {
        (answer.frame, answer.is_height_known): answer.predicted
        for answer in answers
        if not answer.roll_deg and not answer.pitch_deg
    }
    lines = []
    for is_height_known, (roll_deg, pitch_deg) in product((False, True), TILTS):
        of_tilt = [answer for answer in answers if answer[1:4] == (roll_deg, pitch_deg, is_height_known)]
        lines.append(
            {
                "tilt": f"roll {roll_deg:g}" if roll_deg else f"pitch {pitch_deg:g}",
                "height": "given" if is_height_known else "not given",
                "right": sum(answer.predicted == answer.state for answer in of_tilt),
                "wrong": sum(answer.predicted not in (answer.state, None) for answer in of_tilt),
                "silent": sum(answer.predicted is None for answer in of_tilt),
                "changed": sum(
                    answer.predicted != level[answer.frame, is_height_known] for answer in of_tilt
                ),
                "reasons": count_words(answer.reason for answer in of_tilt if answer.predicted is None),
            }
        )
    return Table.from_frame(
        "Answers for tilted cameras",
        pd.DataFrame(lines),
        [
            label_column("tilt", "tilt, deg"),
            label_column("height", "height of the camera"),
            count_column("right", "right state"),
            count_column("wrong", "wrong state"),
            count_column("silent", "no state"),
            count_column("changed", "other answer than without tilt"),
            text_column("reasons"),
        ],
        note=f"{len(level) // 2} frames that Gazebo rendered. Level clouds are turned into the frame of a camera that "
        "looks down (pitch) or is turned clockwise about its axis (roll); the tilt is told from the cloud, zero too.",
    )
