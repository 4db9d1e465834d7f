# SPDX-License-Identifier: Apache-2.0
"""Waiting ends with a state that has held, or with the time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.errors import CloudContentError, ConfigError
from doorstate.inference.door import Door
from doorstate.inference.prediction import Prediction
from doorstate.inference.waiting import wait_for
from doorstate.types import DoorState, Points
from tests.inference.streams import CLOSED, OPEN, UNKNOWN, predict, stamped


def test_waiting_ends_when_the_state_has_held() -> None:
    stream = stamped((20, predict(CLOSED)), (100, predict(OPEN)))
    assert wait_for("open", stream, 30.0, hold_s=1.0)
    stamp_s, _ = next(stream)
    assert 103.3 <= stamp_s <= 103.9  # opened at 102, half a second of evidence, one second held
    assert wait_for(DoorState.CLOSED, stamped((30, predict(CLOSED))), 30.0)


def test_waiting_ends_with_the_time_by_the_stamps() -> None:
    stream = stamped((1000, predict(CLOSED)))
    assert not wait_for("open", stream, 5.0)
    assert next(stream)[0] == pytest.approx(105.2)
    assert not wait_for("open", stamped((30, predict(CLOSED)), (9, predict(OPEN))), 30.0)  # the stream ends
    assert not wait_for("open", stamped((20, predict(OPEN))), 1.0)  # too late by a few frames
    assert not wait_for("open", iter(()), 1.0)


def test_waiting_never_ends_at_a_frame_without_a_state() -> None:
    assert not wait_for("open", stamped((300, UNKNOWN)), 60.0)
    stream = stamped((8, predict(OPEN)), (300, UNKNOWN))
    assert not wait_for("open", stream, 60.0, hold_s=0.5)
    # Nothing holds over long gaps between good frames.
    assert not wait_for("open", stamped(*((1, predict(OPEN)), (9, UNKNOWN)) * 30), 60.0)
    assert wait_for("open", stamped(*((4, predict(OPEN)), (1, UNKNOWN)) * 30), 60.0)


def test_a_last_frame_that_differs_delays_the_end() -> None:
    held = [(1, predict(OPEN))] * 13
    assert wait_for("open", stamped(*held, (1, predict(OPEN))), 60.0)
    assert not wait_for("open", stamped(*held, (1, predict(CLOSED))), 60.0)
    assert wait_for("open", stamped(*held, (1, predict(CLOSED)), (4, predict(OPEN))), 60.0)


def test_an_open_door_without_a_visible_leaf_may_be_glass() -> None:
    def seen(leaf_seen: bool | None) -> Prediction:
        probabilities = predict(OPEN).raw_probabilities
        door = Door(3.0, 0.0, 90.0, 0.9, OPEN, raw_probabilities=probabilities, leaf_seen=leaf_seen)
        return Prediction.from_doors([door], [], 1024, 1.0)

    assert wait_for("open", stamped((40, seen(True))), 60.0)
    assert wait_for("open", stamped((40, seen(None))), 60.0)
    assert not wait_for("open", stamped((40, seen(False))), 60.0)
    assert wait_for("open", stamped((40, seen(False))), 60.0, require_leaf=False)
    assert wait_for("open", stamped((40, seen(False)), (1, seen(True))), 60.0)


def test_clouds_go_through_the_predictor_and_its_errors_are_raised() -> None:
    sizes: list[int] = []

    def predictor(cloud: Points) -> Prediction:
        sizes.append(len(cloud))
        if len(cloud) == 0:
            return UNKNOWN
        if len(cloud) == 1:
            raise CloudContentError("half of the points are more than 1000 m away: millimetres?")
        return predict(OPEN)

    empty, some = np.zeros((0, 3), np.float32), np.ones((5, 3), np.float32)
    stream = [(number / 10, empty if number % 3 == 0 else some) for number in range(40)]
    assert wait_for("open", stream, 10.0, predictor=predictor)
    assert set(sizes) == {0, 5}
    assert not wait_for("open", [(number / 10, empty) for number in range(40)], 10.0, predictor=predictor)
    with pytest.raises(CloudContentError):
        wait_for("open", [(0.0, some), (0.1, some[:1])], 10.0, predictor=predictor)


def test_a_state_that_does_not_exist_is_an_error() -> None:
    for wrong in (
        {"timeout_s": math.nan},
        {"timeout_s": 1.0, "hold_s": -1.0},
        {"timeout_s": 1.0, "hold_s": math.nan},
    ):
        with pytest.raises(ConfigError):
            wait_for("open", [], **wrong)
    with pytest.raises(ConfigError) as caught:
        wait_for("ajar", stamped((1, UNKNOWN)), 1.0)
    assert caught.value.field == "state"
