# SPDX-License-Identifier: Apache-2.0
"""Doors that weights for doorways find in simulated frames: places, states, and false doors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd

from doorstate._jobs import Progress
from doorstate.dataset.crops import HIT_M
from doorstate.doorways.doorway import gap
from doorstate.errors import ConfigError
from doorstate.evaluation.table import Table, count_column, label_column, number_column, text_column
from doorstate.inference.doorway_predictor import DoorwayPredictor
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.simulation.true_door import TrueDoor
from doorstate.simulation.truth import true_doors
from doorstate.types import STATES

from .doorways import (
    SEED,
    SOURCES,
    VISIBLE_PX,
    View,
    by_source,
    nearest,
    simulated_views,
    visible_doors,
)
from .words import count_words

_EXACT_M = 0.1
_LEAF_PX = 150  # of a leaf in view


class FoundDoor(NamedTuple):
    """One visible door, and the nearest answer.

    Attributes:
        preset: kind of rooms.
        sensor: name of the sensor model.
        state: true state.
        shows_leaf: at least 150 pixels see the leaf, without which an opening alone must tell the state.
        position_error_m: distance of the answer; None if there is none within 0.35 m.
        predicted: state of the answer.
        reason: code of the reason why there is no answer, or none with a state.
    """

    preset: str
    sensor: str
    state: str
    shows_leaf: bool
    position_error_m: float | None
    predicted: str | None
    reason: str


class AnsweredFrame(NamedTuple):
    """Doors that a prediction gives for one frame; false ones are not the nearest to any true door."""

    preset: str
    sensor: str
    answers: int
    false_doors: int
    false_states: int  # of these doors


def load_doorway_predictor(weights: str | None) -> DoorwayPredictor:
    """Load weights for doorways by name or path; None: the default network.

    Raises:
        ConfigError: weights for whole clouds.
        WeightsError: no such weights.
    """
    predictor = Predictor.load(weights)
    if not isinstance(predictor, DoorwayPredictor):
        raise ConfigError(
            f"{predictor.name} is for whole clouds", field="weights", expected="weights for doorways"
        )
    return predictor


def measure_doors(
    predictor: Predictor, scenes: int, progress: Progress, seed: int = SEED
) -> tuple[list[FoundDoor], list[AnsweredFrame]]:
    """Return the results of all visible doors and of all frames.

    Args:
        predictor: weights for doorways.
        scenes: scenes of each preset and sensor.
        progress: called after each scene.
        seed: seed of the scenes.
    """
    doors: list[FoundDoor] = []
    frames: list[AnsweredFrame] = []
    for view in simulated_views(SOURCES, scenes, progress, seed):
        prediction = predictor(view.frame.points, is_level=True)
        doors += (found_door(view, door, prediction) for door in visible_doors(view.row))
        frames.append(answered_frame(view, prediction))
    return doors, frames


def found_door(view: View, door: TrueDoor, prediction: Prediction) -> FoundDoor:
    """Return what a prediction says of a door."""
    start = (view.preset, view.sensor, str(door.state), door.visible_px.leaf >= _LEAF_PX)
    answer = nearest(door, prediction.doors)
    if answer is None:
        refused = nearest(door, prediction.refused)
        # Without any candidate the frame was refused as a whole, or shows no wall with a place for a door.
        of_frame = None if prediction.doors or prediction.refused else prediction.abstention
        abstention = of_frame if refused is None else refused.abstention
        return FoundDoor(*start, None, None, "no candidate" if abstention is None else abstention.code)
    reason = "" if answer.abstention is None else answer.abstention.code
    return FoundDoor(*start, gap(door, answer)[0], answer.state, reason)


def answered_frame(view: View, prediction: Prediction) -> AnsweredFrame:
    """Return how many doors a prediction gives, and how many of them are false."""
    nearest_answers = [nearest(door, prediction.doors) for door in true_doors(view.row)]
    false = [door for door in prediction.doors if not any(door is answer for answer in nearest_answers)]
    states = sum(door.state is not None for door in false)
    return AnsweredFrame(view.preset, view.sensor, len(prediction.doors), len(false), states)


def doors_table(doors: Sequence[FoundDoor], frames: Sequence[AnsweredFrame]) -> Table:
    """Return one row per preset and sensor, and one for all: places and states of the doors, and false ones."""
    lines = []
    results = _frame_of(FoundDoor, doors), _frame_of(AnsweredFrame, frames)
    for source, of_doors, answered in by_source(*results):
        error_m = of_doors["position_error_m"].dropna()
        found = of_doors.loc[error_m.index]
        found = found[found["state"].isin(STATES)]
        with_state = found[found["predicted"].notna()]
        is_right = with_state["predicted"] == with_state["state"]
        lines.append(
            source
            | {
                "found": of_doors["position_error_m"].notna().mean(),
                "exact": (error_m <= _EXACT_M).mean(),
                "median": error_m.median() * 100,
                "right": is_right.mean(),
                "right_leaf": is_right[with_state["shows_leaf"].astype(bool)].mean(),
                "silent": found["predicted"].isna().mean(),
                "frames": len(answered),
                "false": answered["false_doors"].mean(),
                "false_states": answered["false_states"].mean(),
            }
        )
    return Table.from_frame(
        "Doors found in simulated frames",
        pd.DataFrame(lines),
        [
            label_column("preset"),
            label_column("sensor"),
            count_column("doors"),
            number_column("found", f"found within {HIT_M:g} m", 3),
            number_column("exact", f"of these within {_EXACT_M:g} m", 3),
            number_column("median", "median error, cm", 1),
            number_column("silent", "without a state", 3),
            number_column("right", "state right, of those with one", 3),
            number_column("right_leaf", "with a leaf in view", 3),
            count_column("frames"),
            number_column("false", "false doors a frame", 2),
            number_column("false_states", "with a state", 2),
        ],
        note=f"Doors with at least {VISIBLE_PX} visible pixels of leaf, frame or opening, in clouds given as level. A "
        "false door is not the nearest answer to any door, however little of that is visible. A leaf is in view if "
        f"at least {_LEAF_PX} pixels see it.",
    )


def reasons_table(doors: Sequence[FoundDoor]) -> Table:
    """Return one row per preset: reasons for doors that are not found, and for answers without a state."""
    lines = []
    for preset in dict.fromkeys(door.preset for door in doors):
        of_preset = [door for door in doors if door.preset == preset]
        found = [door for door in of_preset if door.position_error_m is not None and door.state in STATES]
        with_state = [door for door in found if door.predicted is not None]
        lines.append(
            {
                "preset": preset,
                "not_found": count_words(door.reason for door in of_preset if door.position_error_m is None),
                "silent": count_words(door.reason for door in found if door.predicted is None),
                "wrong": count_words(
                    f"{door.state} as {door.predicted}" for door in with_state if door.predicted != door.state
                ),
            }
        )
    columns = [
        label_column("preset"),
        text_column("not_found", "not found"),
        text_column("silent", "without a state"),
        text_column("wrong", "wrong states"),
    ]
    note = (
        f"*No candidate*: the search proposes nothing within {HIT_M:g} m, or something likelier that overlaps. Other "
        "words are codes of reasons."
    )
    return Table.from_frame("Reasons", pd.DataFrame(lines), columns, note)


def _frame_of(kind: type[FoundDoor | AnsweredFrame], results: Sequence[NamedTuple]) -> pd.DataFrame:
    return pd.DataFrame(results, columns=pd.Index(kind._fields))
