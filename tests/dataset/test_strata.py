# SPDX-License-Identifier: Apache-2.0
"""Bands and regions at their edges, and symmetry of both sides of the door."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.dataset.strata import BANDS, OUTSIDE, REGIONS, distance_band, polar, region

OPPOSITE = dict(zip(REGIONS, reversed(REGIONS), strict=True))


@pytest.mark.parametrize(
    ("distance_m", "name"),
    [
        (1.4999, OUTSIDE),
        (1.5, "1.5-2.0"),
        (1.9999, "1.5-2.0"),
        (2.0, "2.0-2.5"),
        (2.5, "2.5-3.0"),
        (3.0, "3.0-3.5"),
        (3.5, "3.0-3.5"),
        (3.5001, OUTSIDE),
        (-2.0, OUTSIDE),
        (math.nan, OUTSIDE),
    ],
)
def test_edges_of_the_distance_bands(distance_m: float, name: str) -> None:
    assert distance_band(distance_m) == name


@pytest.mark.parametrize(
    ("angle_deg", "name"),
    [
        (-0.001, OUTSIDE),
        (0, "orange"),
        (29.999, "orange"),
        (30, "red"),
        (60, "green"),
        (90, "green"),
        (120, "green"),
        (120.001, "yellow"),
        (150, "yellow"),
        (150.001, "blue"),
        (180, "blue"),
        (180.001, OUTSIDE),
        (math.nan, OUTSIDE),
    ],
)
def test_edges_of_the_regions_belong_to_the_side_of_the_wall_normal(angle_deg: float, name: str) -> None:
    assert region(angle_deg) == name


@given(st.floats(0, 180) | st.sampled_from([0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0]))
@settings(max_examples=100)
def test_regions_are_symmetric(angle_deg: float) -> None:
    mirrored = 180 - angle_deg
    if 180 - mirrored == angle_deg:  # exact in floating point
        assert region(mirrored) == OPPOSITE[region(angle_deg)]


@given(x_m=st.floats(-10, 10), y_m=st.floats(0.01, 10))
@settings(max_examples=100)
def test_polar_coordinates_invert(x_m: float, y_m: float) -> None:
    distance_m, angle_deg = polar(x_m, y_m)
    assert distance_m * math.cos(math.radians(angle_deg)) == pytest.approx(x_m, abs=1e-7)
    assert distance_m * math.sin(math.radians(angle_deg)) == pytest.approx(y_m, abs=1e-7)
    assert region(angle_deg) in REGIONS
    assert distance_band(distance_m) in (*BANDS, OUTSIDE)


def test_a_robot_behind_the_wall_is_outside() -> None:
    assert region(polar(1.0, -1.0)[1]) == OUTSIDE
