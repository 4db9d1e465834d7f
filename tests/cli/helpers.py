# SPDX-License-Identifier: Apache-2.0
"""Checks that several tests of the command line share."""

from __future__ import annotations

from collections.abc import Callable

Run = Callable[..., tuple[int, str, str]]
"""Runs the command line in this process; returns exit code, standard output and standard error."""


def check_error(result: tuple[int, str, str], expected_code: int, *names: str) -> None:
    """Check that a command printed nothing but one line on standard error, which names the given parts."""
    code, out, err = result
    assert (code, out) == (expected_code, "")
    assert err.startswith("doorstate: ")
    assert err.count("\n") == 1
    for name in names:
        assert name in err
