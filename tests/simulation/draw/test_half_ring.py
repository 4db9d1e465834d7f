# SPDX-License-Identifier: Apache-2.0
"""The half-ring of poses has the counts of the paper."""

from __future__ import annotations

import math
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.dataset.strata import BANDS, REGIONS, distance_band, polar, region
from doorstate.errors import ConfigError
from doorstate.simulation.draw.half_ring import Position, draw_heading_offset_deg, half_ring, reduced_ring

RING = half_ring()


def stratum(position: Position) -> tuple[str, str]:
    distance_m, angle_deg = polar(position.x_m, position.y_m)
    return distance_band(distance_m), region(angle_deg)


def test_there_are_1353_positions_as_in_the_paper() -> None:
    assert len(RING) == len(set(RING)) == 1353
    assert all(1.5 <= math.hypot(p.x_m, p.y_m) <= 3.5 and p.y_m >= 0.6 for p in RING)
    assert {Position(-p.column, p.row) for p in RING} == set(RING)
    assert Position(0, 35) in RING
    assert Position(21, 28) not in RING  # exactly 3.5 m, off the axis


def test_positions_have_the_strata_of_table_1() -> None:
    counts = Counter(stratum(position) for position in RING)
    assert [[counts[band, name] for name in REGIONS] for band in BANDS] == [
        [18, 46, 91, 46, 18],
        [30, 59, 115, 59, 30],
        [45, 72, 145, 72, 45],
        [59, 85, 174, 85, 59],
    ]


def test_headings_deviate_from_the_bearing_by_up_to_20_degrees() -> None:
    offsets = [draw_heading_offset_deg(3, index) for index in range(len(RING))]
    assert max(map(abs, offsets)) <= 20
    # A uniform draw of this many covers its range evenly.
    assert [sum(low <= x < low + 10 for x in offsets) for low in (-20, -10, 0, 10)] == pytest.approx(
        [338] * 4, abs=80
    )


def test_a_heading_depends_on_seed_and_position_only() -> None:
    drawn = [draw_heading_offset_deg(seed, index) for seed, index in ((1, 7), (1, 7), (2, 7), (1, 8))]
    assert drawn[0] == drawn[1]
    assert len(set(drawn)) == 3


@given(count=st.integers(1, 1353))
@settings(max_examples=30)
def test_a_reduced_ring_has_the_requested_size(count: int) -> None:
    indices = reduced_ring(count)
    assert indices == sorted(set(indices))
    assert len(indices) == count
    assert 0 <= indices[0] <= indices[-1] < 1353


def test_sixty_positions_cover_every_band_and_region() -> None:
    strata = {stratum(RING[index]) for index in reduced_ring(60)}
    assert {band for band, _ in strata} == set(BANDS)
    assert {name for _, name in strata} == set(REGIONS)
    assert len(strata) >= 16


@pytest.mark.parametrize("count", [0, -1, 1354])
def test_a_reduced_ring_of_an_impossible_size_is_refused(count: int) -> None:
    with pytest.raises(ConfigError, match="1353 positions") as refused:
        reduced_ring(count)
    assert refused.value.field == "poses"
