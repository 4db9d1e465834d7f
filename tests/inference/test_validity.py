# SPDX-License-Identifier: Apache-2.0
"""Broken numbers are no evidence: neither in a filter, nor for waiting, nor as an answer."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.inference.backends import CloudOutputs
from doorstate.inference.decode import decode
from doorstate.inference.prediction import Prediction
from doorstate.inference.state_filter import StateFilter
from doorstate.inference.validity import are_probabilities
from doorstate.inference.waiting import wait_for
from doorstate.types import STATES
from tests.inference.streams import CLOSED, OPEN, predict, stamped

NAN = math.nan
BROKEN = [
    (NAN, NAN, NAN),
    (0.0, 0.0, NAN),
    (math.inf, 0.0, 0.0),
    (-5.0, 3.0, 3.0),
    (0.0, 0.0, 1e9),
    (0.0, 0.0, 0.0),
    (0.5, 0.5, 0.5),
]


@pytest.mark.parametrize("values", BROKEN)
def test_they_are_no_probabilities_and_give_no_answer(values: tuple[float, float, float]) -> None:
    assert not are_probabilities(values)
    prediction = decode(CloudOutputs(np.array(values, np.float32), {}), 0.0, 128, 1.0)
    assert (prediction.state, prediction.probabilities, prediction.raw_probabilities) == (None, None, None)
    assert prediction.abstention is not None
    assert prediction.abstention.code == "invalid_outputs"


@pytest.mark.parametrize(
    "heads", [{"p_door": NAN}, {"p_door": 7.0}, {"p_hinge_left": -1.0}, {"door_x_m": math.inf}]
)
def test_broken_heads_give_no_answer(heads: dict[str, float]) -> None:
    good = np.array([0.1, 0.1, 0.8], np.float32)
    assert decode(CloudOutputs(good, {}), 0.0, 128, 1.0).state == OPEN
    assert decode(CloudOutputs(good, heads), 0.0, 128, 1.0).state is None


@pytest.mark.parametrize("values", BROKEN)
def test_a_broken_frame_changes_nothing_in_a_filter(values: tuple[float, float, float]) -> None:
    broken = Prediction(OPEN, 1, 1.0, raw_probabilities=dict(zip(STATES, values, strict=True)))
    assert not broken.is_evidence
    state_filter = StateFilter()
    for stamp_s, frame in stamped((20, predict(CLOSED)), (3, broken), (20, predict(CLOSED))):
        filtered = state_filter.update(frame, stamp_s)
    assert filtered.state == CLOSED
    assert are_probabilities(list(filtered.probabilities.values()))


@pytest.mark.parametrize("values", BROKEN)
def test_nobody_waits_for_broken_frames(values: tuple[float, float, float]) -> None:
    broken = Prediction(OPEN, 1, 1.0, raw_probabilities=dict(zip(STATES, values, strict=True)))
    assert not wait_for("open", stamped((100, broken)), 30.0, 0.5)
    assert not wait_for("open", stamped((30, predict(CLOSED)), (300, broken)), 60.0, 0.0)
