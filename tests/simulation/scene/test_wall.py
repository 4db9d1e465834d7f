# SPDX-License-Identifier: Apache-2.0
"""Walls with gaps: stretches and lintels fill all of the wall but its gaps."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from doorstate.simulation.scene.door import Door
from doorstate.simulation.scene.plan import collide
from doorstate.simulation.scene.wall import Gap, door_gap, wall_boxes

GAPS = st.lists(st.tuples(st.floats(0.2, 0.9), st.floats(0.5, 2.5)), max_size=4)


@given(GAPS, st.floats(0.05, 0.4), st.floats(-3, 3))
def test_boxes_fill_the_wall_beside_and_above_its_gaps(
    sizes: list[tuple[float, float]], thickness: float, start: float
) -> None:
    gaps, x = [], start
    for half_width, top in sizes:
        x += half_width + 0.1
        gaps.append(Gap(x, half_width, top))
        x += half_width
    ends = (start, x + 0.5)
    boxes = wall_boxes(ends, thickness, 2.6, gaps)
    solid = sum(math.prod(box.size_m) for box in boxes)
    free = sum(2 * gap.half_width_m * gap.top_m for gap in gaps)
    assert solid == pytest.approx(thickness * ((ends[1] - ends[0]) * 2.6 - free))
    for number, box in enumerate(boxes):
        assert box.center_m[1] + box.size_m[1] / 2 == pytest.approx(0, abs=1e-12)
        assert not collide([box], boxes[:number], 1e-9)


def test_a_door_fills_its_gap_and_a_gap_as_high_as_the_wall_has_no_lintel() -> None:
    assert door_gap(Door(), 1.0) == Gap(1.0, 0.48, 2.13)
    assert len(wall_boxes((-2, 2), 0.1, 2.13, [door_gap(Door())])) == 2
