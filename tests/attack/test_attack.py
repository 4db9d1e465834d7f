# SPDX-License-Identifier: Apache-2.0
"""Each attack in its short form; `python -m tests.attack` repeats them in full."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.attack import ATTACKS
from tests.attack.tries import Try, Violation, attempt, table


@pytest.mark.parametrize("name", ATTACKS)
def test_nothing_gives_way(name: str, tmp_path: Path) -> None:
    tries = list(ATTACKS[name](tmp_path, 1))
    assert tries
    assert [one for one in tries if one.violation] == []


def test_what_gives_way_is_counted() -> None:
    def fail() -> str:
        raise AssertionError("open")

    def crash() -> str:
        raise KeyError

    tries = [attempt("a", fail, Violation.NUMBERS), attempt("a", crash), Try("b", "refused")]
    text = table(tries)
    assert "| a | 2 | open: 1, KeyError: 1 |" in text
    for violation, number in ((Violation.NUMBERS, 1), (Violation.UNCAUGHT, 1), (Violation.TORN, 0)):
        assert f"| {violation} | {number} |" in text
