# SPDX-License-Identifier: Apache-2.0
"""Tests of paper.measurements.buildings."""

from __future__ import annotations

from paper.measurements.buildings import NAMES, measure_buildings, quantile_table, share_table

from doorstate._jobs import no_progress


def test_views_and_contents_are_described() -> None:
    measured = measure_buildings(2, no_progress)
    assert set(measured) == set(NAMES)
    assert all(len(one.rows) == len(one.draw_s) == 2 for one in measured.values())
    views = quantile_table(measured)
    for row in views.rows:
        values = [float(cell) for cell in row[2:]]
        assert values == sorted(values)
    assert {row[0] for row in views.rows} == set(NAMES)
    shares = [row for row in share_table(measured).rows if row[:2] == ("building", "layout")]
    assert sum(int(row[3].split()[0]) for row in shares) == 100
