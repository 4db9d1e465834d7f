# SPDX-License-Identifier: Apache-2.0
"""Counts of words in one cell of a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


def count_words(words: Iterable[str]) -> str:
    """Return words with their counts, the commonest first."""
    return ", ".join(f"{word} {count}" for word, count in Counter(words).most_common())
