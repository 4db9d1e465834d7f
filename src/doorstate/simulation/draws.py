# SPDX-License-Identifier: Apache-2.0
"""Random numbers of a scene: they depend on the seed, the scene's number and what is drawn, and on nothing else."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")


class Draws:
    """One stream of draws; lengths are whole tenths of a millimetre, so that rows stay short and exact."""

    def __init__(self, seed: int, index: int, what: str) -> None:
        # Spawn keys, unlike longer seeds, are never one another's beginning padded with zeros (paper/log.md).
        key = (index, zlib.crc32(what.encode()))
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))

    def between(self, low: float, high: float, digits: int = 4) -> float:
        """Uniform in [low, high], rounded to `digits` decimals."""
        return min(max(round(float(self._rng.uniform(low, high)), digits), low), high)

    def chance(self, share: float) -> bool:
        """True in this share of the draws."""
        return bool(self._rng.random() < share)

    def one_of(self, shares: Mapping[Choice, float]) -> Choice:
        """One of the keys, by their shares of the sum."""
        options = list(shares)
        edges = np.cumsum([shares[option] for option in options])
        number = np.searchsorted(edges, self._rng.random() * edges[-1], side="right")
        return options[min(int(number), len(options) - 1)]

    def whole(self, low: int, high: int) -> int:
        """A whole number in [low, high]."""
        return int(self._rng.integers(low, high, endpoint=True))
