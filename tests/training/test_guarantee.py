# SPDX-License-Identifier: Apache-2.0
"""Guaranteed thresholds hold as often as they promise, and only where scenes and errors allow them."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from doorstate.training.guarantee import (
    CONFIDENCE,
    STARTS,
    guaranteed_threshold,
    one_sample_a_scene,
    p_value,
)

ALLOWED = (1 - CONFIDENCE) / len(STARTS)
WRONG_SHARE = 0.02
Samples = tuple[NDArray[np.float64], NDArray[np.bool_]]


def risk(threshold: float, overconfidence: float) -> float:
    """Return the true share of wrong answers of `draw` from a threshold on."""
    return overconfidence * (1 - max(threshold, 0.8)) / 2  # the mean of 1 - confidence above the threshold


def draw(rng: np.random.Generator, scenes: int, overconfidence: float) -> Samples:
    """Return probabilities drawn evenly from 0.8 to 1, and outcomes wrong more often than these say."""
    confidence = rng.uniform(0.8, 1, scenes)
    return confidence, rng.random(scenes) >= overconfidence * (1 - confidence)


@pytest.mark.parametrize(("overconfidence", "passing"), [(0.1, 0.99), (0.3, 0.6), (1.0, 0.0)])
def test_the_guarantee_fails_in_at_most_the_stated_share_of_draws(
    overconfidence: float, passing: float
) -> None:
    rng = np.random.default_rng(0)
    draws, broken, passed = 300, 0, 0
    for _ in range(draws):
        found = guaranteed_threshold(*draw(rng, 2000, overconfidence), WRONG_SHARE)
        passed += found is not None
        broken += found is not None and risk(found[0], overconfidence) > WRONG_SHARE
    assert broken <= (1 - CONFIDENCE) * draws
    assert passed >= passing * draws  # it is not kept by refusing


def test_weights_that_never_meet_it_rarely_get_a_threshold() -> None:
    """All thresholds are as bad as just not allowed, so any that passes breaks the guarantee."""
    rng = np.random.default_rng(1)
    samples = ((rng.choice([0.5, 0.93, 0.99], 500), rng.random(500) >= WRONG_SHARE) for _ in range(1000))
    passed = sum(guaranteed_threshold(*sample, WRONG_SHARE) is not None for sample in samples)
    assert passed / 1000 <= 1 - CONFIDENCE


@given(st.integers(0, 60), st.floats(0.01, 0.5), st.data())
def test_p_value_is_the_tail_of_the_binomial(answered: int, share: float, data: st.DataObject) -> None:
    wrong = data.draw(st.integers(0, answered))
    tail = sum(
        comb(answered, count) * share**count * (1 - share) ** (answered - count) for count in range(wrong + 1)
    )
    assert p_value(answered, wrong, share) == pytest.approx(tail)
    assert p_value(answered, wrong, share) <= p_value(answered, min(wrong + 1, answered), share) + 1e-12
    assert p_value(answered + 1, wrong, share) <= p_value(answered, wrong, share) + 1e-12


def test_without_errors_the_number_of_answers_decides() -> None:
    needed = int(np.ceil(np.log(ALLOWED) / np.log(1 - WRONG_SHARE)))
    for scenes, passes in ((needed - 1, False), (needed, True)):
        found = guaranteed_threshold(np.full(scenes, 0.99), np.ones(scenes, bool), WRONG_SHARE)
        assert (found is not None) == passes
    assert found is not None
    threshold, guarantee = found
    assert threshold == 0.34  # every probability of a predicted state is higher
    assert (guarantee.scenes, guarantee.answered, guarantee.wrong) == (needed, needed, 0)
    assert (guarantee.wrong_share, guarantee.confidence) == (WRONG_SHARE, CONFIDENCE)


@pytest.mark.parametrize("scenes", [0, 1, 5000])
def test_nothing_right_or_nothing_at_all_has_no_threshold(scenes: int) -> None:
    assert guaranteed_threshold(np.full(scenes, 0.99), np.zeros(scenes, bool), WRONG_SHARE) is None


def test_one_scene_is_too_few() -> None:
    assert guaranteed_threshold(np.array([0.99]), np.array([True]), WRONG_SHARE) is None


def test_equal_probabilities_are_answered_or_refused_together() -> None:
    """Ten of the 400 answers at 0.8 are wrong, which is too many: these 400 are refused, and no others."""
    confidence = np.repeat([0.99, 0.8], 400)
    correct = np.ones(800, bool)
    correct[400:430] = False
    found = guaranteed_threshold(confidence, correct, WRONG_SHARE)
    assert found is not None
    threshold, guarantee = found
    assert threshold == 0.81
    assert (guarantee.answered, guarantee.wrong) == (400, 0)


def test_few_strict_answers_do_not_hide_the_lenient_ones() -> None:
    """At 0.97 only ten answer, which proves nothing; the chain from 0.9 passes."""
    confidence = np.repeat([0.985, 0.92], [10, 400])
    found = guaranteed_threshold(confidence, np.ones(410, bool), WRONG_SHARE)
    assert found is not None
    assert found[1].answered == 410


@given(seed=st.integers(0, 2**32 - 1), errors=st.integers(0, 30))
def test_more_errors_never_lower_the_threshold(seed: int, errors: int) -> None:
    rng = np.random.default_rng(seed)
    confidence, correct = draw(rng, 600, 0.2)
    worse = correct.copy()
    worse[rng.permutation(600)[:errors]] = False
    fewer, more = (guaranteed_threshold(confidence, each, WRONG_SHARE) for each in (correct, worse))
    assert more is None or (fewer is not None and fewer[0] <= more[0])


@given(st.lists(st.sampled_from("abcd"), max_size=30), st.integers(0, 2**32 - 1))
def test_every_scene_counts_once(scenes: list[str], seed: int) -> None:
    chosen = one_sample_a_scene(scenes, seed)
    assert sorted(scenes[index] for index in chosen) == sorted(set(scenes))
    assert (np.diff(chosen) > 0).all()
    np.testing.assert_array_equal(chosen, one_sample_a_scene(scenes, seed))


def test_the_sample_of_a_scene_is_drawn_evenly() -> None:
    counts = np.bincount([one_sample_a_scene(["a"] * 4, seed)[0] for seed in range(2000)], minlength=4)
    assert counts == pytest.approx([500] * 4, rel=0.15)
