# SPDX-License-Identifier: Apache-2.0
"""Intervals against hand-worked numbers and slow twins."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.evaluation.intervals import bootstrap_f1, grouped_interval, wilson_interval
from doorstate.evaluation.metrics import macro_f1
from doorstate.types import STATES


def draw(count: int, error_rate: float, seed: int) -> pd.DataFrame:
    """Return predictions with a share of errors, each of the next state."""
    generator = np.random.default_rng(seed)
    true = generator.integers(0, 3, count)
    predicted = np.where(generator.random(count) < error_rate, (true + 1) % 3, true)
    names = np.array(STATES)
    return pd.DataFrame({"state": names[true], "predicted": names[predicted]})


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (0, 10, 0.0, 3.841459 / 13.841459),  # z^2 / (n + z^2)
        (10, 10, 10 / 13.841459, 1.0),
        (5, 10, 0.236593, 0.763407),
        (81, 263, 0.255289, 0.366184),  # Newcombe 1998, table I, method 3: 0.2553 to 0.3662
    ],
)
def test_wilson_interval_by_hand(successes: int, trials: int, low: float, high: float) -> None:
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)


def test_intervals_without_samples_are_undefined() -> None:
    assert np.isnan(wilson_interval(0, 0)).all()
    assert np.isnan(grouped_interval(np.array([], dtype=np.bool_), [])).all()
    assert np.isnan(bootstrap_f1(draw(0, 0, 0), [], np.random.default_rng(0)).macro).all()


@settings(max_examples=40)
@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_independent_samples_have_wilsons_interval(correct: list[bool]) -> None:
    interval = grouped_interval(np.array(correct), [str(number) for number in range(len(correct))])
    assert interval == pytest.approx(wilson_interval(sum(correct), len(correct)), abs=1e-9)


@settings(max_examples=40)
@given(st.lists(st.booleans(), min_size=1, max_size=12), st.integers(2, 5))
def test_repeated_samples_add_nothing(correct: list[bool], copies: int) -> None:
    groups = [str(number) for number in range(len(correct)) for _ in range(copies)]
    interval = grouped_interval(np.repeat(correct, copies), groups)
    assert interval == pytest.approx(wilson_interval(sum(correct), len(correct)), abs=1e-9)


def test_one_large_group_counts_for_little_more_than_one_sample() -> None:
    correct = np.array([True] * 10 + [False] * 5)
    low, high = grouped_interval(correct, ["lab"] * 13 + ["x", "y"])
    assert low < 0.15
    assert high > 0.95


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_intervals_of_groups_contain_the_share(seed: int) -> None:
    rng = np.random.default_rng(seed)
    correct, groups = rng.random(20) < 0.5, rng.integers(0, 6, 20).astype(str).tolist()
    low, high = grouped_interval(correct, groups)
    assert 0 <= low <= correct.mean() <= high <= 1


def test_bootstrap_equals_drawing_clusters_one_by_one() -> None:
    predictions = draw(240, 0.15, 2)
    clusters = [str(n // 3) for n in range(240)]
    fast = bootstrap_f1(predictions, clusters, np.random.default_rng(0), resamples=4000)
    generator, values = np.random.default_rng(1), []
    for _ in range(1000):
        clusters_drawn = generator.integers(0, 80, 80)
        samples = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in clusters_drawn])
        values.append(macro_f1(predictions.iloc[samples]))
    assert fast.macro == pytest.approx(tuple(np.quantile(values, [0.025, 0.975])), abs=0.01)


def test_bootstrap_is_wider_when_samples_come_in_threes() -> None:
    predictions = draw(100, 0.1, 3)
    tripled = predictions.loc[np.repeat(predictions.index, 3)]
    together = bootstrap_f1(tripled, [str(n // 3) for n in range(300)], np.random.default_rng(0))
    apart = bootstrap_f1(tripled, [str(n) for n in range(300)], np.random.default_rng(0))
    assert np.ptp(together.macro) > 1.4 * np.ptp(apart.macro)  # in theory the square root of 3


def test_bootstrap_repeats_with_its_seed_and_shrinks_without_errors() -> None:
    predictions = draw(90, 0.2, 4)
    names = [str(n) for n in range(90)]
    runs = [bootstrap_f1(predictions, names, np.random.default_rng(5)) for _ in range(2)]
    assert runs[0] == runs[1]
    perfect = bootstrap_f1(
        predictions.assign(predicted=predictions["state"]), names, np.random.default_rng(5)
    )
    assert perfect.macro == (1.0, 1.0)
    assert perfect.per_state == ((1.0, 1.0),) * 3


def test_bootstrap_of_an_absent_state_is_undefined_for_it_alone() -> None:
    states = ["closed", "closed", "semi_open", "semi_open"] * 10
    predictions = pd.DataFrame({"state": states, "predicted": states})
    intervals = bootstrap_f1(predictions, [str(n) for n in range(40)], np.random.default_rng(0))
    assert intervals.per_state[0] == (1.0, 1.0)
    assert all(math.isnan(end) for end in intervals.per_state[2])
