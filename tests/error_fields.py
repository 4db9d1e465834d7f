# SPDX-License-Identifier: Apache-2.0
"""Checks of the fields of an error, for `pytest.raises(..., check=...)`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from doorstate.errors import DoorstateError


def about(path: Path) -> Callable[[DoorstateError], bool]:
    """Return a check that an error names this file or folder."""
    return lambda error: error.path == path
