# SPDX-License-Identifier: Apache-2.0
"""A header may declare no more than its file holds: checked before anything of that size is allocated."""

from __future__ import annotations

from doorstate.errors import CloudReadError


def check_declared(declared: int, present: int, unit: str) -> None:
    """Raise CloudReadError when a negative number of units is declared, or more than is present."""
    if declared < 0:
        raise CloudReadError(f"is damaged: {declared} {unit} are declared")
    if declared > present:
        raise CloudReadError(f"is truncated: {declared} {unit} are declared, {present} are there")
