# SPDX-License-Identifier: Apache-2.0
"""Draws of a scene: the same for the same key, independent for any other."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from doorstate.simulation.draws import Draws


def first(seed: int, index: int, what: str) -> list[float]:
    draws = Draws(seed, index, what)
    return [draws.between(0, 1, 12) for _ in range(4)]


def test_a_key_draws_the_same_again_and_other_keys_something_else() -> None:
    keys = [
        (seed, index, what) for seed in (0, 1, 2**40) for index in (0, 1, 2) for what in ("varied", "a", "")
    ]
    drawn = {key: first(*key) for key in keys}
    assert all(first(*key) == numbers for key, numbers in drawn.items())
    numbers = [number for found in drawn.values() for number in found]
    assert len(set(numbers)) == len(numbers)


def test_neighbouring_keys_are_uncorrelated() -> None:
    numbers = np.array([[*first(0, index, "varied"), *first(0, index, "cluttered")] for index in range(2000)])
    correlation = np.corrcoef(numbers, rowvar=False) - np.eye(8)
    assert np.abs(correlation).max() < 0.1
    assert np.abs(np.corrcoef(numbers[1:, 0], numbers[:-1, 0])[0, 1]) < 0.1


def test_lengths_are_tenths_of_millimetres_within_their_limits() -> None:
    draws = Draws(0, 0, "lengths")
    drawn = [draws.between(0.62, 1.05) for _ in range(500)]
    assert all(number == round(number, 4) for number in drawn)
    assert 0.62 <= min(drawn) < 0.63
    assert 1.04 < max(drawn) <= 1.05
    assert Draws(0, 0, "x").between(1.00004, 1.00006) in (1.00004, 1.00006)


def test_choices_come_by_their_shares() -> None:
    draws = Draws(0, 0, "choices")
    counts = Counter(draws.one_of({"a": 3.0, "b": 1.0, "never": 0.0}) for _ in range(4000))
    assert counts["a"] / 4000 == pytest.approx(0.75, abs=0.03)
    assert set(counts) == {"a", "b"}
    assert sum(draws.chance(0.2) for _ in range(4000)) / 4000 == pytest.approx(0.2, abs=0.03)
    assert {draws.whole(2, 4) for _ in range(200)} == {2, 3, 4}
