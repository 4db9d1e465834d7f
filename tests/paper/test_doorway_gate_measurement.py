# SPDX-License-Identifier: Apache-2.0
"""Tests of paper.measurements.doorway_gate."""

from __future__ import annotations

from collections import Counter
from itertools import product

import pytest
from paper.measurements import doorway_gate

from doorstate._jobs import no_progress
from doorstate.types import STATES


def test_every_leaf_is_checked_as_it_is_and_dark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doorway_gate, "SOURCES", (("varied", "xtion"),))
    results = doorway_gate.measure_doorway_gate(3, no_progress)
    leaves = ["glass", "glazed", "dark glazed", "opaque", "dark opaque"]
    assert Counter((result.state, result.leaf) for result in results) == Counter(product(STATES, leaves))
    dark = [result for result in results if result.leaf.startswith("dark")]
    assert not any(result.leaf_seen for result in dark)
    assert all(result.is_open for result in results if result.leaf_seen)
    rows = doorway_gate.doorway_gate_table(results).rows
    assert sum(int(row[4]) for row in rows) == len(results)
    assert all(0 <= float(cell) <= 1 for row in rows for cell in row[5:])
