# SPDX-License-Identifier: Apache-2.0
"""Outcomes of attacks, and the table of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from doorstate.errors import DoorstateError


class Violation(StrEnum):
    """Outcome that must not be."""

    UNCAUGHT = "uncaught exceptions and crashes"
    NUMBERS = "answers from broken numbers"
    TORN = "torn or mixed files"
    OUTSIDE = "bytes outside the folders given"
    OBEYED = "names obeyed as code"


class Try(NamedTuple):
    """One try of an attack."""

    kind: str  # line of the table
    outcome: str
    violation: Violation | None = None


Attack = Callable[[Path, int], Iterator[Try]]
"""Attack in an empty folder, with a number of rounds: one for a test, a hundred in full."""


def attempt(kind: str, action: Callable[[], str], violation: Violation = Violation.UNCAUGHT) -> Try:
    """Return the outcome of an action: what it returns, "refused" or a violation.

    Args:
        kind: line of the table.
        action: returns an outcome; AssertionError is the given violation, other exceptions are uncaught ones.
        violation: what a failed assertion means.
    """
    try:
        return Try(kind, action())
    except DoorstateError as error:
        return Try(kind, "several lines", Violation.UNCAUGHT) if "\n" in str(error) else Try(kind, "refused")
    except AssertionError as error:
        return Try(kind, str(error) or "failed", violation)
    except Exception as error:  # what an attack looks for
        return Try(kind, type(error).__name__, Violation.UNCAUGHT)


def table(tries: Iterable[Try]) -> str:
    """Return the outcomes as a Markdown table, and the violations as another."""
    outcomes: dict[str, Counter[str]] = {}
    violations: Counter[Violation] = Counter()
    for one in tries:
        outcomes.setdefault(one.kind, Counter())[one.outcome] += 1
        violations[one.violation] += 1 if one.violation else 0
    rows = [
        f"| {kind} | {counts.total()} | {', '.join(f'{name}: {count}' for name, count in counts.most_common())} |"
        for kind, counts in outcomes.items()
    ]
    sums = [f"| {violation} | {violations[violation]} |" for violation in Violation]
    tried = sum(counts.total() for counts in outcomes.values())
    head = ["| attack | tried | outcome |", "|---|---:|---|", *rows, "", "| of all | number |", "|---|---:|"]
    return "\n".join([*head, f"| tried | {tried} |", *sums]) + "\n"
