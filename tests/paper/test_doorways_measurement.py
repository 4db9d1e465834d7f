# SPDX-License-Identifier: Apache-2.0
"""Tests of paper.measurements.doorways."""

from __future__ import annotations

import pytest
from paper.measurements import doorways

from doorstate._jobs import no_progress


def test_doors_and_candidates_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doorways, "SOURCES", (("varied", "none"), ("no-door", "none")))
    doors, frames, hits = doorways.measure_doorways(1, no_progress)
    assert [door.preset for door in doors] == ["varied"] * 3
    assert len(frames) == 4
    assert all(door.is_near for door in doors if door.is_exact or door.is_first)
    text = doorways.doorways_table(doors, frames).to_markdown()
    assert text.count("| varied |") == 1
    assert len(hits) >= sum(door.is_near for door in doors) > 0
    table = doorways.errors_table(hits)
    assert sum(int(row[1]) for row in table.rows) == len(hits)
