# SPDX-License-Identifier: Apache-2.0
"""A door state prints, compares and serialises as its name."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from doorstate.types import LABELS, STATES, DoorState


class Record(BaseModel):
    state: DoorState


@pytest.mark.parametrize(("state", "name"), list(zip(DoorState, STATES, strict=True)))
def test_a_state_is_its_name(state: DoorState, name: str) -> None:
    assert (str(state), f"{state}", f"{state:9}", state) == (name, name, f"{name:9}", name)
    assert json.loads(json.dumps({state: state})) == {name: name}
    assert Record(state=state).model_dump(mode="json") == {"state": name}
    assert Record.model_validate_json(f'{{"state": "{name}"}}').state is state
    stream = io.StringIO()
    csv.writer(stream).writerow([state])
    assert stream.getvalue() == f"{name}\r\n"
    assert np.asarray([state]).tolist() == [name]
    assert {name: 1}[state] == 1
    assert state


@pytest.mark.parametrize(
    ("text", "state"),
    [
        ("open", DoorState.OPEN),
        ("Closed", DoorState.CLOSED),
        ("semi-open", DoorState.SEMI_OPEN),
        ("Semi Open", DoorState.SEMI_OPEN),
        ("SEMI_OPEN", DoorState.SEMI_OPEN),
    ],
)
def test_usual_spellings_are_taken(text: str, state: DoorState) -> None:
    assert DoorState(text) is state
    assert Record(state=text).state is state  # type: ignore[arg-type]


@pytest.mark.parametrize("value", ["", "ajar", "semiopen", 2, None, True])
def test_anything_else_is_no_state(value: object) -> None:
    with pytest.raises(ValueError, match="not a valid DoorState"):
        DoorState(value)
    with pytest.raises(ValidationError):
        Record(state=value)  # type: ignore[arg-type]


def test_classes_are_numbered_as_in_published_files() -> None:
    assert STATES == ("closed", "semi_open", "open")
    assert [state.class_index for state in DoorState] == [0, 1, 2]
    assert [DoorState.from_index(index) for index in np.arange(3)] == list(DoorState)
    for index in (-1, 3):
        with pytest.raises(ValueError, match="no class"):
            DoorState.from_index(index)


def test_numbers_of_labels_are_those_of_stored_data_sets() -> None:
    assert LABELS == ("closed", "semi_open", "open", "no_door", "unknown")
    assert LABELS[: len(STATES)] == STATES
    with pytest.raises(ValueError, match="unknown"):
        DoorState("unknown")
