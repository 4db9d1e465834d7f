# SPDX-License-Identifier: Apache-2.0
"""Confusion matrices and scores against scikit-learn and hand-worked numbers."""

from __future__ import annotations

import math
import statistics

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import f1_score, precision_recall_fscore_support

from doorstate.evaluation.metrics import (
    accuracy,
    confusion,
    macro_f1,
    mean_and_deviation,
    precision_recall_f1,
    ratio,
)
from doorstate.types import NO_DOOR, PREDICTED_LABELS, STATES

labels = st.lists(
    st.tuples(st.sampled_from(STATES), st.sampled_from(PREDICTED_LABELS)), min_size=1, max_size=60
)


def frame_of(pairs: list[tuple[str, str]]) -> pd.DataFrame:
    """Return predictions from pairs of true state and predicted label."""
    return pd.DataFrame(pairs, columns=["state", "predicted"])


def test_confusion_by_hand() -> None:
    pairs = [("closed", "closed"), *[("closed", "semi_open")] * 2, ("semi_open", "semi_open")]
    pairs += [("semi_open", "open"), ("open", "open"), ("open", "abstained")]
    assert confusion(frame_of(pairs)).tolist() == [[1, 2, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1]]


def test_samples_without_a_door_are_not_counted() -> None:
    counts = confusion(pd.DataFrame({"state": [NO_DOOR, "open"], "predicted": [None, "open"]}))
    assert counts.sum() == counts[2, 2] == 1


def test_no_samples_give_an_empty_confusion_and_undefined_scores() -> None:
    counts = confusion(frame_of([]))
    assert counts.tolist() == [[0] * 4] * 3
    assert np.isnan(precision_recall_f1(counts).f1).all()
    assert math.isnan(accuracy(counts))


@settings(max_examples=40)
@given(labels)
def test_confusion_sums(pairs: list[tuple[str, str]]) -> None:
    counts = confusion(frame_of(pairs))
    true, predicted = zip(*pairs, strict=True)
    assert counts.sum() == len(pairs)
    assert counts.sum(axis=1).tolist() == [true.count(state) for state in STATES]
    assert counts.sum(axis=0).tolist() == [predicted.count(label) for label in PREDICTED_LABELS]
    assert accuracy(counts) == pytest.approx(np.mean([one == two for one, two in pairs]))


@settings(max_examples=40)
@given(labels)
def test_scores_equal_scikit_learn(pairs: list[tuple[str, str]]) -> None:
    score = precision_recall_f1(confusion(frame_of(pairs)))
    true, predicted = zip(*pairs, strict=True)
    expected = precision_recall_fscore_support(true, predicted, labels=STATES, zero_division=np.nan)
    np.testing.assert_allclose(score.precision, expected[0])
    np.testing.assert_allclose(score.recall, expected[1])
    np.testing.assert_allclose(score.f1, expected[2])


def test_macro_f1_equals_scikit_learn() -> None:
    rng = np.random.default_rng(1)
    true, predicted = rng.choice(STATES, 200), rng.choice(STATES, 200)
    frame = pd.DataFrame({"state": true, "predicted": predicted})
    assert macro_f1(frame) == pytest.approx(f1_score(true, predicted, average="macro"))


def test_precision_and_recall_are_not_swapped() -> None:
    # One of four closed doors is recognised (recall 1/4); everything predicted closed is closed (precision 1).
    score = precision_recall_f1(np.array([[1, 3, 0], [0, 5, 0], [0, 0, 5]]))
    assert (score.recall[0], score.precision[0]) == (0.25, 1.0)


def test_undefined_is_nan_and_makes_the_mean_undefined() -> None:
    score = precision_recall_f1(np.array([[4, 0, 0], [0, 0, 0], [0, 0, 2]]))
    assert np.isnan([score.precision[1], score.recall[1], score.f1[1]]).all()
    assert np.isnan(float(score.macro.f1))
    assert ratio([1, 0], [2, 0]).tolist()[0] == 0.5


def test_mean_and_deviation() -> None:
    values = [0.98, 0.99, 0.97, 1.0]
    assert mean_and_deviation(values) == pytest.approx((statistics.mean(values), statistics.stdev(values)))
    mean, deviation = mean_and_deviation([0.5])
    assert mean == 0.5
    assert math.isnan(deviation)
    assert math.isnan(mean_and_deviation([])[0])
