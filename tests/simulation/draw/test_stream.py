# SPDX-License-Identifier: Apache-2.0
"""Random streams: the same for the same key, independent for different keys."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from doorstate.simulation.draw.stream import Stream


def first(seed: int, index: int, name: str) -> list[float]:
    stream = Stream(seed, index, name)
    return [stream.uniform(0, 1, 12) for _ in range(4)]


def test_each_key_repeats_its_own_numbers() -> None:
    keys = [
        (seed, index, name) for seed in (0, 1, 2**40) for index in (0, 1, 2) for name in ("varied", "a", "")
    ]
    drawn = {key: first(*key) for key in keys}
    assert all(first(*key) == numbers for key, numbers in drawn.items())
    numbers = [number for values in drawn.values() for number in values]
    assert len(set(numbers)) == len(numbers)


def test_neighbouring_keys_are_uncorrelated() -> None:
    numbers = np.array([[*first(0, index, "varied"), *first(0, index, "cluttered")] for index in range(2000)])
    correlation = np.corrcoef(numbers, rowvar=False) - np.eye(8)
    assert np.abs(correlation).max() < 0.1
    assert np.abs(np.corrcoef(numbers[1:, 0], numbers[:-1, 0])[0, 1]) < 0.1


def test_lengths_are_multiples_of_a_tenth_of_a_millimetre() -> None:
    stream = Stream(0, 0, "lengths")
    drawn = [stream.uniform(0.62, 1.05) for _ in range(500)]
    assert all(number == round(number, 4) for number in drawn)
    assert 0.62 <= min(drawn) < 0.63
    assert 1.04 < max(drawn) <= 1.05
    assert Stream(0, 0, "x").uniform(1.00004, 1.00006) in (1.00004, 1.00006)


def test_choices_follow_their_weights() -> None:
    stream = Stream(0, 0, "choices")
    counts = Counter(stream.choice({"a": 3.0, "b": 1.0, "never": 0.0}) for _ in range(4000))
    assert counts["a"] / 4000 == pytest.approx(0.75, abs=0.03)
    assert set(counts) == {"a", "b"}
    assert sum(stream.chance(0.2) for _ in range(4000)) / 4000 == pytest.approx(0.2, abs=0.03)
    assert {stream.integer(2, 4) for _ in range(200)} == {2, 3, 4}
