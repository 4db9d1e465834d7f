# SPDX-License-Identifier: Apache-2.0
"""Checks and settings that all fuzz targets share."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from doorstate.errors import MAX_MESSAGE_LENGTH, DoorstateError

LIMIT_S = 1.0  # of processor time
Target = Callable[[], None]


def outcome_of(work: Callable[[], str]) -> str:
    """Return the result of `work`, or the name of the package's error that it raised.

    Raises:
        AssertionError: the work took too long, or the error is not one line.
    """
    started = time.process_time()
    try:
        outcome = work()
    except DoorstateError as error:
        check_line(str(error))
        outcome = type(error).__name__
    assert time.process_time() - started < LIMIT_S
    return outcome


def check_line(text: str) -> None:
    """Assert that a reason can be printed, in one line."""
    assert text.isprintable()
    assert 0 < len(text) <= MAX_MESSAGE_LENGTH


def fuzz_target(test: Callable[..., Any], **strategies: st.SearchStrategy[Any]) -> Target:
    """Return a hypothesis test that calls `test` with a hundred inputs, the same in every run."""

    def target(**inputs: Any) -> None:
        test(**inputs)

    quick = settings(
        max_examples=100,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    return quick(given(**strategies)(target))
