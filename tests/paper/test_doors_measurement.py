# SPDX-License-Identifier: Apache-2.0
"""Tests of paper.measurements.doors and tilted_answers."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest
from paper.answers import gazebo_frames, gazebo_heights_m
from paper.measurements import doors as doors_measurement
from paper.measurements import tilted_answers
from paper.measurements.__main__ import app
from paper.measurements.doors import (
    AnsweredFrame,
    FoundDoor,
    answered_frame,
    doors_table,
    found_door,
    measure_doors,
    reasons_table,
)
from paper.measurements.doorways import View, visible_doors
from typer.testing import CliRunner

from doorstate._jobs import no_progress
from doorstate.inference.abstention import Abstention
from doorstate.inference.door import Door
from doorstate.inference.doorway_predictor import DoorwayPredictor
from doorstate.inference.prediction import Prediction
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.truth import true_doors
from doorstate.types import STATES
from tests.inference.scripted_doorways import ScriptedBackend, outputs


@pytest.fixture(scope="module")
def view() -> View:
    """Corridor of which at least two doors are visible."""
    for index in range(10):
        for row, frame in zip(*simulate_rows(PRESETS["corridor"], 3, index), strict=True):
            if len(visible_doors(row)) >= 2:
                return View("corridor", "none", row, frame)
    raise AssertionError


def _answers(view: View) -> list[Door]:
    """Return right answers for all doors of a view."""
    return [Door(d.x_m, d.y_m, d.yaw_deg, d.width_m, d.state) for d in true_doors(view.row)]


def _prediction(doors: list[Door], refused: list[Door]) -> Prediction:
    return Prediction.from_doors(doors, refused, 1024, 1.0)


def test_right_answers_are_found_and_none_is_false(view: View) -> None:
    prediction = _prediction(_answers(view), [])
    found = [found_door(view, door, prediction) for door in visible_doors(view.row)]
    assert {door.position_error_m for door in found} == {0.0}
    assert all(door.predicted == door.state for door in found)
    assert answered_frame(view, prediction) == AnsweredFrame(
        "corridor", "none", len(true_doors(view.row)), 0, 0
    )


def test_second_answers_and_those_beside_the_doors_are_false(view: View) -> None:
    first = _answers(view)[0]
    double = replace(first, x_m=first.x_m + 0.1)
    beside = replace(first, x_m=first.x_m + 9, state=None, abstention=Abstention("unsure"))
    assert answered_frame(view, _prediction([first, double, beside], []))[2:] == (3, 2, 1)
    door = true_doors(view.row)[0]
    assert found_door(view, door, _prediction([double], [])).position_error_m == pytest.approx(0.1)


def test_doors_that_are_not_found_have_a_reason(view: View) -> None:
    door, other, *_ = true_doors(view.row)
    first, second, *_ = _answers(view)
    refused = replace(first, state=None, abstention=Abstention("no_door", {"probability": 0.1}))
    assert found_door(view, door, _prediction([second], [refused])).reason == "no_door"
    assert found_door(view, other, _prediction([first], [])).reason == "no candidate"
    of_frame = Prediction.abstain(Abstention("low_coverage"))
    assert found_door(view, door, of_frame).reason == "low_coverage"
    unsure = found_door(view, door, _prediction([replace(refused, abstention=Abstention("unsure"))], []))
    assert (unsure.position_error_m, unsure.predicted, unsure.reason) == (0.0, None, "unsure")


def test_every_preset_has_a_row() -> None:
    doors = [
        FoundDoor("corridor", "xtion", "open", True, 0.05, "open", ""),
        FoundDoor("corridor", "xtion", "open", False, 0.2, "closed", ""),
        FoundDoor("corridor", "xtion", "closed", True, 0.05, None, "unsure"),
        FoundDoor("corridor", "xtion", "closed", True, None, None, "no_door"),
    ]
    frames = [AnsweredFrame("corridor", "xtion", 3, 1, 1), AnsweredFrame("no-door", "xtion", 0, 0, 0)]
    rows = doors_table(doors, frames).rows
    assert rows[0][2:] == ("4", "0.750", "0.667", "5.0", "0.333", "0.500", "1.000", "1", "1.00", "1.00")
    assert rows[1][:4] == ("no-door", "xtion", "0", "–")
    assert reasons_table(doors).rows == (("corridor", "no_door 1", "unsure 1", "open as closed 1"),)


def _always_closed(count: int) -> DoorwayPredictor:
    return DoorwayPredictor(ScriptedBackend([outputs("closed")] * count), gate=None)


def test_frames_are_answered_by_preset_and_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doors_measurement, "SOURCES", (("varied", "none"), ("no-door", "none")))
    doors, frames = measure_doors(_always_closed(40), 1, no_progress, seed=2)
    assert [(door.state, door.predicted) for door in doors] == [(str(state), "closed") for state in STATES]
    assert [frame.preset for frame in frames] == ["varied"] * 3 + ["no-door"]
    assert frames[0].answers > 0


def test_a_tilt_does_not_change_what_is_always_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tilted_answers, "gazebo_frames", lambda: islice(gazebo_frames(), 1, 2))
    monkeypatch.setattr(tilted_answers, "gazebo_heights_m", lambda: gazebo_heights_m()[1:2])
    answers = tilted_answers.measure_tilted_answers(_always_closed(120), no_progress)
    assert len(answers) == 2 * 7
    assert {answer.predicted for answer in answers} == {"closed"}
    rows = tilted_answers.tilted_answers_table(answers).rows
    assert [row[0] for row in rows[:7]][::3] == ["pitch 0", "pitch 30", "roll 30"]
    assert [row[1] for row in rows] == ["not given"] * 7 + ["given"] * 7
    assert {row[4:] for row in rows} == {("0", "0", "–")}


def test_weights_for_whole_clouds_are_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["doors", "--weights", "ogurob-pointnet2", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert not list(tmp_path.iterdir())
