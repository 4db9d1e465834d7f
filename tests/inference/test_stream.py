# SPDX-License-Identifier: Apache-2.0
"""A stream's state changes with evidence only, and waiting ends with a state that held or with the time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.errors import CloudContentError, ConfigError
from doorstate.inference.abstention import Abstention
from doorstate.inference.prediction import Prediction
from doorstate.inference.stream import FilteredState, StateFilter, wait_for
from doorstate.types import DoorState, Points

OPEN, CLOSED, SEMI_OPEN = DoorState.OPEN, DoorState.CLOSED, DoorState.SEMI_OPEN
UNKNOWN = Prediction.abstain(Abstention("hole", {"share": 0.3, "free_reach_m": 4.0}))


def says(state: DoorState, probability: float = 0.9) -> Prediction:
    rest = (1 - probability) / 2
    return Prediction(
        state, {each.label: probability if each == state else rest for each in DoorState}, 1024, 1.0
    )


def frames(*parts: tuple[int, Prediction], rate_hz: float = 10.0) -> Iterator[tuple[float, Prediction]]:
    number = itertools.count()
    return iter([(100.0 + next(number) / rate_hz, frame) for count, frame in parts for _ in range(count)])


def after(stream: Iterator[tuple[float, Prediction]]) -> list[FilteredState]:
    state_filter = StateFilter()
    return [state_filter.update(frame, stamp_s) for stamp_s, frame in stream]


def changes(states: Sequence[DoorState | None]) -> int:
    return sum(a != b for a, b in itertools.pairwise(states))


predictions = st.one_of(
    st.just(UNKNOWN),
    st.builds(says, st.sampled_from(DoorState), st.floats(0.34, 1.0)),
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
            assert now.probabilities[now.state.label] >= 0.5
        changed = before is None or now.state != before.state
        assert now.since_s == (stamp_s if changed else before.since_s)
        if changed and now.state is not None:
            assert now.probabilities[now.state.label] >= 0.8
            assert frame.state is not None  # a frame without a state brings none
        before = now


@given(st.lists(gaps_s, min_size=1, max_size=40))
def test_frames_without_a_state_never_make_one(gaps: list[float]) -> None:
    seen = after((stamp_s, UNKNOWN) for stamp_s in itertools.accumulate(gaps))
    assert {now.state for now in seen} == {None}
    np.testing.assert_allclose(list(seen[-1].probabilities.values()), 1 / 3)


@given(st.sampled_from(DoorState), st.floats(0.34, 1.0), gaps_s, gaps_s)
def test_no_one_frame_brings_a_state(state: DoorState, p: float, wait_s: float, more_s: float) -> None:
    stamps = itertools.accumulate((0.0, wait_s, more_s))
    seen = after(zip(stamps, (UNKNOWN, says(state, p), UNKNOWN), strict=True))
    assert {now.state for now in seen} == {None}


@given(st.lists(st.sampled_from(DoorState), min_size=30, max_size=120), st.floats(0.5, 0.99))
def test_it_never_changes_more_often_than_its_frames(states: list[DoorState], p: float) -> None:
    seen = after(frames(*((1, says(state, p)) for state in states)))
    found = [now.state for now in seen if now.state is not None]
    assert changes(found) <= changes(states)


def test_alternating_noise_changes_nothing() -> None:
    noise = frames(*((1, says(state)) for state in (OPEN, CLOSED) * 50))
    assert {now.state for now in after(noise)} == {None}


def test_a_fifth_of_wrong_frames_changes_a_tenth_as_often_as_raw() -> None:
    rng = np.random.default_rng(0)
    states = [SEMI_OPEN if rng.random() < 0.2 else OPEN for _ in range(2000)]
    seen = after(frames(*((1, says(state)) for state in states)))
    assert changes(states) > 500
    assert changes([now.state for now in seen]) <= changes(states) / 10


def test_the_posterior_is_that_of_the_chain_written_out() -> None:
    keep = 1.5 * 0.7 - 0.5  # of the part that is not uniform, in a second; 0.7 = 1/3 + 2/3 keep
    transition = keep * np.eye(3) + (1 - keep) / 3  # its diagonal is 0.7
    np.testing.assert_allclose(np.diag(transition), 0.7)
    belief = np.full(3, 1 / 3)
    for state in (OPEN, OPEN, CLOSED):
        given = np.full(3, 0.05)
        given[state] = 0.9
        belief = (transition.T @ belief) * np.sqrt(0.94 * given + 0.02)
        belief /= belief.sum()
    first = (0.0, UNKNOWN)
    seen = after(iter([first, (1.0, says(OPEN)), (2.0, says(OPEN)), (3.0, says(CLOSED))]))
    np.testing.assert_allclose(list(seen[-1].probabilities.values()), belief)


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 30.0, 90.0])
def test_a_change_takes_about_half_a_second_at_any_frame_rate(rate_hz: float) -> None:
    second = round(rate_hz)
    seen = after(frames((3 * second, says(CLOSED)), (2 * second, says(OPEN)), rate_hz=rate_hz))
    assert seen[3 * second - 1].state == CLOSED
    opened_s = seen[-1].since_s - 103.0
    assert seen[-1].state == OPEN
    assert 0.3 <= opened_s <= 0.8


def test_a_state_is_forgotten_without_frames_that_have_one() -> None:
    seen = after(frames((30, says(OPEN)), (40, UNKNOWN)))
    assert seen[29].state == OPEN
    assert seen[30].state == OPEN
    assert seen[-1].state is None
    assert 1.0 <= seen[-1].since_s - 103.0 <= 3.0


def test_an_earlier_stamp_starts_anew_and_the_same_stamp_adds_nothing() -> None:
    state_filter = StateFilter()
    for stamp_s, frame in frames((30, says(OPEN))):
        last = state_filter.update(frame, stamp_s)
    again = state_filter.update(says(CLOSED), stamp_s)
    assert again.probabilities == pytest.approx(last.probabilities)
    anew = state_filter.update(says(OPEN), 5.0)
    assert anew.state is None
    assert anew.since_s == 5.0


def test_impossible_parameters_and_stamps_are_errors() -> None:
    for wrong in (
        {"stay_per_s": 0.3},
        {"enter": 0.4, "leave": 0.4},
        {"leave": 0.9},
        {"evidence_s": 0.0},
        {"floor": 0.0},
    ):
        with pytest.raises(ConfigError, match="a filter needs"):
            StateFilter(**wrong)
    with pytest.raises(ConfigError, match="number of seconds"):
        StateFilter().update(UNKNOWN, math.nan)


def test_waiting_ends_when_the_state_has_held() -> None:
    stream = frames((20, says(CLOSED)), (100, says(OPEN)))
    assert wait_for("open", stream, 30.0, hold_s=1.0)
    stamp_s, _ = next(stream)
    assert 103.3 <= stamp_s <= 103.9  # opened at 102, half a second of evidence, one second held
    assert wait_for(DoorState.CLOSED, frames((30, says(CLOSED))), 30.0)


def test_waiting_ends_with_the_time_by_the_stamps() -> None:
    stream = frames((1000, says(CLOSED)))
    assert not wait_for("open", stream, 5.0)
    assert next(stream)[0] == pytest.approx(105.2)
    assert not wait_for("open", frames((30, says(CLOSED)), (9, says(OPEN))), 30.0)  # the stream ends
    assert not wait_for("open", frames((20, says(OPEN))), 1.0)  # too late by a few frames
    assert not wait_for("open", iter(()), 1.0)


def test_waiting_is_never_over_without_a_state() -> None:
    assert not wait_for("open", frames((300, UNKNOWN)), 60.0)
    stream = frames((8, says(OPEN)), (300, UNKNOWN))
    assert not wait_for("open", stream, 60.0, hold_s=0.5)
    # Long gaps between good frames: nobody looked, so nothing held.
    assert not wait_for("open", frames(*((1, says(OPEN)), (9, UNKNOWN)) * 30), 60.0)
    assert wait_for("open", frames(*((4, says(OPEN)), (1, UNKNOWN)) * 30), 60.0)


def test_a_last_frame_that_disagrees_puts_it_off() -> None:
    held = [(1, says(OPEN))] * 13
    assert wait_for("open", frames(*held, (1, says(OPEN))), 60.0)
    assert not wait_for("open", frames(*held, (1, says(CLOSED))), 60.0)
    assert wait_for("open", frames(*held, (1, says(CLOSED)), (4, says(OPEN))), 60.0)


def test_clouds_go_through_the_predictor_and_wrong_ones_are_its_error() -> None:
    asked: list[int] = []

    def predictor(cloud: Points) -> Prediction:
        asked.append(len(cloud))
        if len(cloud) == 0:
            return UNKNOWN
        if len(cloud) == 1:
            raise CloudContentError("half of the points are more than 1000 m away: millimetres?")
        return says(OPEN)

    empty, some = np.zeros((0, 3), np.float32), np.ones((5, 3), np.float32)
    stream = [(number / 10, empty if number % 3 == 0 else some) for number in range(40)]
    assert wait_for("open", stream, 10.0, predictor=predictor)
    assert set(asked) == {0, 5}
    assert not wait_for("open", [(number / 10, empty) for number in range(40)], 10.0, predictor=predictor)
    with pytest.raises(CloudContentError, match="millimetres"):
        wait_for("open", [(0.0, some), (0.1, some[:1])], 10.0, predictor=predictor)


def test_a_state_that_does_not_exist_is_an_error() -> None:
    for wrong in (
        {"timeout_s": math.nan},
        {"timeout_s": 1.0, "hold_s": -1.0},
        {"timeout_s": 1.0, "hold_s": math.nan},
    ):
        with pytest.raises(ConfigError, match="seconds, zero or more"):
            wait_for("open", [], **wrong)
    with pytest.raises(ConfigError, match="there are closed, semi_open, open"):
        wait_for("ajar", frames((1, UNKNOWN)), 1.0)
