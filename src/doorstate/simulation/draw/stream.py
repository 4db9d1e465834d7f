# SPDX-License-Identifier: Apache-2.0
"""Random numbers of one scene; they depend on the seed, the scene's number and the preset's name alone."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")


class Stream:
    """One stream of random numbers; lengths are multiples of 0.1 mm, so that manifest rows stay short and exact."""

    def __init__(self, seed: int, index: int, name: str) -> None:
        # Spawn keys, because numpy pads short seeds with zeros: [1] and [1, 0] would be one stream.
        key = (index, zlib.crc32(name.encode()))
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))

    def uniform(self, low: float, high: float, digits: int = 4) -> float:
        """Return a number in [low, high], rounded to `digits` decimals."""
        return min(max(round(float(self._rng.uniform(low, high)), digits), low), high)

    def chance(self, probability: float) -> bool:
        """Return True with this probability."""
        return bool(self._rng.random() < probability)

    def choice(self, weights: Mapping[Choice, float]) -> Choice:
        """Return one of the keys, with probabilities in proportion to the weights."""
        options = list(weights)
        edges = np.cumsum([weights[option] for option in options])
        number = np.searchsorted(edges, self._rng.random() * edges[-1], side="right")
        return options[min(int(number), len(options) - 1)]

    def integer(self, low: int, high: int) -> int:
        """Return a whole number in [low, high]."""
        return int(self._rng.integers(low, high, endpoint=True))
