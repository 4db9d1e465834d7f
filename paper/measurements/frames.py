# SPDX-License-Identifier: Apache-2.0
"""Simulated doors that no weights were trained on."""

from __future__ import annotations

from collections.abc import Iterator

from doorstate._jobs import Progress
from doorstate.inference.reference_clouds import reference_rows
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.row import Row


def reference_frames(count: int, progress: Progress) -> Iterator[tuple[Row, Frame]]:
    """Yield rows and frames of simulated doors in all states."""
    for number, row in enumerate(reference_rows(count)):
        progress(number, count)
        yield row, replay(row)
    progress(count, count)
