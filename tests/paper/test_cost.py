# SPDX-License-Identifier: Apache-2.0
"""Reckoned time of published trainings on other machines."""

from __future__ import annotations

import pytest
from paper.cost import reckon_cost, schedule_length


def test_runs_start_where_a_place_is_free_first() -> None:
    assert schedule_length([3, 1, 1, 1], 2) == 3
    assert schedule_length([1, 1, 3], 2) == 4
    assert schedule_length([2, 5, 1], 8) == 5


def test_the_longest_run_bounds_the_time() -> None:
    few, many, quick = (reckon_cost("paper", *case) for case in ((2,), (64,), (64, 4.0)))
    assert few.run_hours / 2 <= few.hours < few.run_hours / 2 + many.hours
    assert many.hours == reckon_cost("paper", 25).hours
    assert quick.hours == pytest.approx(many.hours / 4)
