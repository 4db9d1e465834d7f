# SPDX-License-Identifier: Apache-2.0
"""Summary of `doorstate predict`: counts of the states, and alike errors as one line."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from statistics import median
from typing import Any

from doorstate.cli.console import stderr, stdout
from doorstate.types import ABSTAINED, STATES


class PredictionSummary:
    """Counts predictions and failures.

    Args:
        noun: noun of a cloud, such as "file".

    Attributes:
        clouds: number of clouds so far.
    """

    def __init__(self, noun: str) -> None:
        self._noun = noun
        self.clouds = 0
        self._states: dict[str, Counter[str | None]] = {}
        self._milliseconds: dict[str, list[float]] = {}
        self._errors: list[tuple[str, str]] = []

    @property
    def failures(self) -> int:
        """Number of clouds without a prediction."""
        return len(self._errors)

    def add(self, name: str, rows: list[dict[str, Any]]) -> None:
        """Count the predictions of all methods for one cloud, or its error."""
        self.clouds += 1
        error = next((row["error"] for row in rows if "error" in row), None)
        if error is not None:
            self._errors.append((name, error))
            return
        for row in rows:
            self._states.setdefault(row["method"], Counter())[row["state"]] += 1
            self._milliseconds.setdefault(row["method"], []).append(row["milliseconds"])

    def print_errors(self) -> None:
        """Print one line for each kind of error on standard error."""
        print_errors(self._errors, self._noun)

    def print_failures(self) -> None:
        """Print the number of failures on standard error, if there are any."""
        if self.failures:
            stderr.print(f"no prediction for {self.failures} of {self._count(self.clouds)}")

    def print_counts(self, end: str = "") -> None:
        """Print a line for each method on standard output.

        Args:
            end: text after the counts.
        """
        failed = f"; no prediction for {self.failures}" if self.failures else ""
        for method, states in self._states.items():
            counts = [f"{states[state]} {state}" for state in STATES if states[state]]
            counts += [f"{states[None]} {ABSTAINED}"] if states[None] else []
            label = f"{method}: " if len(self._states) > 1 else ""
            stdout.print(
                f"{label}{self._count(self.clouds)}: {', '.join(counts)}{failed}; "
                f"{median(self._milliseconds[method]):.0f} ms each{end}"
            )

    def _count(self, number: int) -> str:
        return count(number, self._noun)


def print_errors(errors: Sequence[tuple[str, str]], noun: str) -> None:
    """Print one line for each kind of error on standard error.

    Args:
        errors: name and error of each thing that failed.
        noun: their noun, such as "file".
    """
    kinds: dict[str, list[tuple[str, str]]] = {}
    for name, error in errors:
        kinds.setdefault(re.sub(r"\d+", "0", error), []).append((name, error))  # alike but for numbers
    for cases in kinds.values():
        name, error = cases[0]
        single = len(cases) == 1
        line = f"{name}: {error}" if single else f"{count(len(cases), noun)}: {error}; first: {name}"
        stderr.print(line, style="red")


def count(number: int, noun: str) -> str:
    """Return a number with its noun, such as `3 files`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
