# SPDX-License-Identifier: Apache-2.0
"""The filtered state changes only with evidence, and never for a single frame."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.errors import ConfigError
from doorstate.inference.prediction import Prediction
from doorstate.inference.state_filter import FilteredState, StateFilter
from doorstate.types import DoorState
from tests.inference.streams import CLOSED, OPEN, SEMI_OPEN, UNKNOWN, predict, stamped


def after(stream: Iterator[tuple[float, Prediction]]) -> list[FilteredState]:
    state_filter = StateFilter()
    return [state_filter.update(frame, stamp_s) for stamp_s, frame in stream]


def changes(states: Sequence[DoorState | None]) -> int:
    return sum(a != b for a, b in itertools.pairwise(states))


predictions = st.one_of(
    st.just(UNKNOWN),
    st.builds(predict, st.sampled_from(DoorState), st.floats(0.34, 1.0)),
)
gaps_s = st.floats(0.0, 5.0)


@given(st.lists(st.tuples(gaps_s, predictions), min_size=1, max_size=40))
def test_probabilities_sum_to_one_and_a_state_has_evidence(steps: list[tuple[float, Prediction]]) -> None:
    state_filter, stamp_s, before = StateFilter(), 0.0, None
    for gap_s, frame in steps:
        stamp_s += gap_s
        now = state_filter.update(frame, stamp_s)
        assert math.isclose(sum(now.probabilities.values()), 1.0, rel_tol=1e-9)
        assert min(now.probabilities.values()) > 0
        if now.state is not None:
            assert now.probabilities[now.state] >= 0.5
        changed = before is None or now.state != before.state
        assert now.since_s == (stamp_s if changed else before.since_s)
        if changed and now.state is not None:
            assert now.probabilities[now.state] >= 0.8
            assert frame.state is not None  # a frame without a state brings none
        before = now


@given(st.lists(gaps_s, min_size=1, max_size=40))
def test_frames_without_a_state_begin_none(gaps: list[float]) -> None:
    filtered = after((stamp_s, UNKNOWN) for stamp_s in itertools.accumulate(gaps))
    assert {now.state for now in filtered} == {None}
    np.testing.assert_allclose(list(filtered[-1].probabilities.values()), 1 / 3)


@given(st.sampled_from(DoorState), st.floats(0.34, 1.0), gaps_s, gaps_s)
def test_a_single_frame_begins_no_state(state: DoorState, p: float, wait_s: float, more_s: float) -> None:
    stamps = itertools.accumulate((0.0, wait_s, more_s))
    filtered = after(zip(stamps, (UNKNOWN, predict(state, p), UNKNOWN), strict=True))
    assert {now.state for now in filtered} == {None}


@given(st.lists(st.sampled_from(DoorState), min_size=30, max_size=120), st.floats(0.5, 0.99))
def test_the_state_changes_no_more_often_than_the_frames(states: list[DoorState], p: float) -> None:
    filtered = after(stamped(*((1, predict(state, p)) for state in states)))
    known = [now.state for now in filtered if now.state is not None]
    assert changes(known) <= changes(states)


def test_alternating_noise_changes_nothing() -> None:
    noise = stamped(*((1, predict(state)) for state in (OPEN, CLOSED) * 50))
    assert {now.state for now in after(noise)} == {None}


def test_a_fifth_of_wrong_frames_changes_a_tenth_as_often_as_raw() -> None:
    rng = np.random.default_rng(0)
    states = [SEMI_OPEN if rng.random() < 0.2 else OPEN for _ in range(2000)]
    filtered = after(stamped(*((1, predict(state)) for state in states)))
    assert changes(states) > 500
    assert changes([now.state for now in filtered]) <= changes(states) / 10


def test_the_posterior_equals_the_explicit_markov_chain() -> None:
    keep = 1.5 * 0.7 - 0.5  # of the part that is not uniform, in a second; 0.7 = 1/3 + 2/3 keep
    transition = keep * np.eye(3) + (1 - keep) / 3  # its diagonal is 0.7
    np.testing.assert_allclose(np.diag(transition), 0.7)
    belief = np.full(3, 1 / 3)
    for state in (OPEN, OPEN, CLOSED):
        evidence = np.full(3, 0.05)
        evidence[state.class_index] = 0.9
        belief = (transition.T @ belief) * np.sqrt(0.94 * evidence + 0.02)
        belief /= belief.sum()
    first = (0.0, UNKNOWN)
    filtered = after(iter([first, (1.0, predict(OPEN)), (2.0, predict(OPEN)), (3.0, predict(CLOSED))]))
    np.testing.assert_allclose(list(filtered[-1].probabilities.values()), belief)


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 30.0, 90.0])
def test_a_change_takes_about_half_a_second_at_any_frame_rate(rate_hz: float) -> None:
    second = round(rate_hz)
    filtered = after(stamped((3 * second, predict(CLOSED)), (2 * second, predict(OPEN)), rate_hz=rate_hz))
    assert filtered[3 * second - 1].state == CLOSED
    opened_s = filtered[-1].since_s - 103.0
    assert filtered[-1].state == OPEN
    assert 0.3 <= opened_s <= 0.8


def test_a_state_is_forgotten_without_frames_that_have_one() -> None:
    filtered = after(stamped((30, predict(OPEN)), (40, UNKNOWN)))
    assert filtered[29].state == OPEN
    assert filtered[30].state == OPEN
    assert filtered[-1].state is None
    assert 1.0 <= filtered[-1].since_s - 103.0 <= 3.0


def test_an_earlier_stamp_resets_and_the_same_stamp_adds_nothing() -> None:
    state_filter = StateFilter()
    for stamp_s, frame in stamped((30, predict(OPEN))):
        last = state_filter.update(frame, stamp_s)
    again = state_filter.update(predict(CLOSED), stamp_s)
    assert again.probabilities == pytest.approx(last.probabilities)
    reset = state_filter.update(predict(OPEN), 5.0)
    assert reset.state is None
    assert reset.since_s == 5.0


def test_the_state_of_a_rule_counts_as_a_certain_one() -> None:
    rule = Prediction(OPEN, 1000, 1.0)
    ((_, certain), (_, of_rule)) = (after(stamped((2, frame))) for frame in (predict(OPEN, 1.0), rule))
    assert of_rule == certain
    assert of_rule.probabilities["open"] > 0.5


def test_impossible_parameters_and_stamps_are_errors() -> None:
    for wrong in (
        {"stay_probability": 0.3},
        {"enter_probability": 0.4, "leave_probability": 0.4},
        {"leave_probability": 0.9},
        {"full_weight_s": 0.0},
        {"min_likelihood": 0.0},
    ):
        with pytest.raises(ConfigError):
            StateFilter(**wrong)
    with pytest.raises(ConfigError) as caught:
        StateFilter().update(UNKNOWN, math.nan)
    assert caught.value.field == "stamp_s"
