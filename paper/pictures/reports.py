# SPDX-License-Identifier: Apache-2.0
"""Figures of rendered reports."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..report import write_published_report


def draw(experiment: str, figure: str) -> bytes:
    """Return a figure of the report of a published experiment as PNG."""
    with tempfile.TemporaryDirectory() as folder:
        write_published_report(experiment, Path(folder))
        return (Path(folder) / "figures" / f"{figure}.png").read_bytes()
