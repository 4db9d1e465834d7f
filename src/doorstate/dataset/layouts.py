# SPDX-License-Identifier: Apache-2.0
"""Published data sets by name: which of their files hold clouds, what they show, and how they are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from doorstate.dataset.deepdoors2 import deepdoors2_rows, read_deepdoors2
from doorstate.errors import ConfigError
from doorstate.io.options import ReadOptions
from doorstate.types import Points


class Layout(NamedTuple):
    """How a published data set is laid out."""

    rows: Callable[
        [Path], list[dict[str, str]]
    ]  # one a cloud: sample_id, state, file below the folder, whatever else
    read: Callable[[Path, ReadOptions], Points]


LAYOUTS: dict[str, Layout] = {"deepdoors2": Layout(deepdoors2_rows, read_deepdoors2)}


def find_layout(name: str) -> Layout:
    """A layout by name.

    Raises:
        ConfigError: there is none of that name.
    """
    if name not in LAYOUTS:
        raise ConfigError(f"no layout {name!r}: choose one of {', '.join(LAYOUTS)}")
    return LAYOUTS[name]
