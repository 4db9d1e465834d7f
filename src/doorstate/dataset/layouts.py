# SPDX-License-Identifier: Apache-2.0
"""Layouts of published data sets by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from doorstate.dataset.deepdoors2 import deepdoors2_rows, read_deepdoors2
from doorstate.errors import unknown_name
from doorstate.io.options import ReadOptions
from doorstate.types import Points


class Layout(NamedTuple):
    """Functions that list and read the clouds of a published data set."""

    rows: Callable[[Path], list[dict[str, str]]]
    """One row for each cloud of a folder: sample_id, state, file below the folder, further columns."""
    read: Callable[[Path, ReadOptions], Points]


LAYOUTS: dict[str, Layout] = {"deepdoors2": Layout(deepdoors2_rows, read_deepdoors2)}


def find_layout(name: str) -> Layout:
    """Return a layout by name.

    Raises:
        ConfigError: no such layout.
    """
    if name not in LAYOUTS:
        raise unknown_name("layout", name, LAYOUTS, field="layout")
    return LAYOUTS[name]
