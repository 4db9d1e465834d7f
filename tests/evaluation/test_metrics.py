# SPDX-License-Identifier: Apache-2.0
"""Metrics against scikit-learn, hand-worked numbers, and slow twins."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import f1_score, precision_recall_fscore_support

from doorstate.evaluation.metrics import (
    accuracy,
    bootstrap_f1,
    confusion_matrix,
    holm,
    mcnemar,
    mean_and_deviation,
    ratio,
    scores,
    wilson_interval,
)
from doorstate.types import Indices

labels = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 3)), min_size=1, max_size=60)


def _draw(count: int, error_rate: float, seed: int) -> tuple[Indices, Indices]:
    generator = np.random.default_rng(seed)
    true = generator.integers(0, 3, count)
    predicted = np.where(generator.random(count) < error_rate, (true + 1) % 3, true)
    return true, predicted


def test_confusion_by_hand() -> None:
    true = np.array([0, 0, 0, 1, 1, 2, 2])
    predicted = np.array([0, 1, 1, 1, 2, 2, 3])
    assert confusion_matrix(true, predicted).tolist() == [[1, 2, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1]]


def test_no_samples_give_an_empty_confusion_and_undefined_scores() -> None:
    empty = np.array([], dtype=np.int64)
    confusion = confusion_matrix(empty, empty)
    assert confusion.tolist() == [[0] * 4] * 3
    assert np.isnan(scores(confusion).f1).all()
    assert math.isnan(accuracy(confusion))


@settings(deadline=None, max_examples=60)
@given(labels)
def test_confusion_sums(pairs: list[tuple[int, int]]) -> None:
    true, predicted = np.array(pairs).T
    confusion = confusion_matrix(true, predicted)
    assert confusion.sum() == len(pairs)
    assert confusion.sum(axis=1).tolist() == [np.count_nonzero(true == k) for k in range(3)]
    assert confusion.sum(axis=0).tolist() == [np.count_nonzero(predicted == k) for k in range(4)]
    assert accuracy(confusion) == pytest.approx(np.mean(true == predicted))


@settings(deadline=None, max_examples=60)
@given(labels)
def test_scores_are_scikit_learns(pairs: list[tuple[int, int]]) -> None:
    true, predicted = np.array(pairs).T
    score = scores(confusion_matrix(true, predicted))
    expected = precision_recall_fscore_support(true, predicted, labels=[0, 1, 2], zero_division=np.nan)
    np.testing.assert_allclose(score.precision, expected[0])
    np.testing.assert_allclose(score.recall, expected[1])
    np.testing.assert_allclose(score.f1, expected[2])


def test_macro_f1_is_scikit_learns() -> None:
    true, predicted = _draw(200, 0.2, 1)
    macro = scores(confusion_matrix(true, predicted)).macro
    assert float(macro.f1) == pytest.approx(f1_score(true, predicted, average="macro"))


def test_precision_and_recall_are_not_swapped() -> None:
    # One of four closed doors is found (recall 1/4); everything called closed is closed (precision 1).
    score = scores(np.array([[1, 3, 0], [0, 5, 0], [0, 0, 5]]))
    assert (score.recall[0], score.precision[0]) == (0.25, 1.0)


def test_undefined_is_nan_and_spreads_to_the_mean() -> None:
    score = scores(np.array([[4, 0, 0], [0, 0, 0], [0, 0, 2]]))
    assert np.isnan([score.precision[1], score.recall[1], score.f1[1]]).all()
    assert np.isnan(float(score.macro.f1))
    assert ratio([1, 0], [2, 0]).tolist()[0] == 0.5


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


def test_wilson_interval_of_nothing_is_undefined() -> None:
    assert np.isnan(wilson_interval(0, 0)).all()


def test_bootstrap_equals_drawing_clusters_one_by_one() -> None:
    true, predicted = _draw(240, 0.15, 2)
    clusters = [str(n // 3) for n in range(240)]
    fast = bootstrap_f1(true, predicted, clusters, np.random.default_rng(0), resamples=4000)
    generator, values = np.random.default_rng(1), []
    for _ in range(1500):
        drawn = generator.integers(0, 80, 80)
        samples = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in drawn])
        values.append(float(scores(confusion_matrix(true[samples], predicted[samples])).macro.f1))
    assert fast.macro == pytest.approx(tuple(np.quantile(values, [0.025, 0.975])), abs=0.008)


def test_bootstrap_is_wider_when_samples_come_in_threes() -> None:
    true, predicted = _draw(100, 0.1, 3)
    tripled = np.repeat(true, 3), np.repeat(predicted, 3)
    together = bootstrap_f1(*tripled, [str(n // 3) for n in range(300)], np.random.default_rng(0))
    apart = bootstrap_f1(*tripled, [str(n) for n in range(300)], np.random.default_rng(0))
    assert np.ptp(together.macro) > 1.4 * np.ptp(apart.macro)  # in theory the square root of 3


def test_bootstrap_repeats_with_its_seed_and_shrinks_without_errors() -> None:
    true, predicted = _draw(90, 0.2, 4)
    names = [str(n) for n in range(90)]
    runs = [bootstrap_f1(true, predicted, names, np.random.default_rng(5)) for _ in range(2)]
    assert runs[0] == runs[1]
    perfect = bootstrap_f1(true, true, names, np.random.default_rng(5))
    assert perfect.macro == (1.0, 1.0)
    assert perfect.per_state == ((1.0, 1.0),) * 3


def test_bootstrap_of_an_absent_state_is_undefined_for_it_alone() -> None:
    true = np.array([0, 0, 1, 1] * 10)
    intervals = bootstrap_f1(true, true, [str(n) for n in range(40)], np.random.default_rng(0))
    assert intervals.per_state[0] == (1.0, 1.0)
    assert np.isnan(intervals.per_state[2]).all()
    empty = np.array([], dtype=np.int64)
    assert np.isnan(bootstrap_f1(empty, empty, [], np.random.default_rng(0)).macro).all()


def test_mcnemar_by_hand() -> None:
    first = np.array([True] * 8 + [False] * 2 + [True] * 30 + [False] * 5)
    second = np.array([False] * 8 + [True] * 2 + [True] * 30 + [False] * 5)
    test = mcnemar(first, second)
    assert (test.only_first_right, test.only_second_right) == (8, 2)
    assert test.p_value == pytest.approx(2 * (1 + 10 + 45) / 2**10)
    assert mcnemar(second, first).p_value == pytest.approx(test.p_value)
    assert mcnemar(first, first).p_value == 1.0


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def test_mean_and_deviation() -> None:
    values = [0.98, 0.99, 0.97, 1.0]
    assert mean_and_deviation(values) == pytest.approx((statistics.mean(values), statistics.stdev(values)))
    mean, deviation = mean_and_deviation([0.5])
    assert mean == 0.5
    assert math.isnan(deviation)
    assert math.isnan(mean_and_deviation([])[0])
