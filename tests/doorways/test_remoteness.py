# SPDX-License-Identifier: Apache-2.0
"""Order of doors by distance and bearing."""

from __future__ import annotations

import math

import pytest

from doorstate.doorways.remoteness import remoteness_m


@pytest.mark.parametrize(("bearing_deg", "times"), [(0, 1), (30, 2), (-30, 2), (60, 5)])
def test_doors_beside_the_axis_count_as_farther(bearing_deg: float, times: float) -> None:
    bearing = math.radians(bearing_deg)
    assert remoteness_m(3 * math.cos(bearing), 3 * math.sin(bearing)) == pytest.approx(3 * times)
