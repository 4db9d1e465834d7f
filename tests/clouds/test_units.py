# SPDX-License-Identifier: Apache-2.0
"""Clouds in other units than metres."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.clouds.units import check_units, median_range_m
from doorstate.errors import CloudContentError

CLOUD = np.random.default_rng(0).uniform(0.5, 4.0, (500, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("factor", "suggestions"),
    [(1000, {"units_m": 0.001}), (100, {"units_m": 0.01}), (15000, {}), (0.001, {"units_m": 1000.0})],
)
def test_the_likely_unit_is_suggested(factor: float, suggestions: dict[str, float]) -> None:
    with pytest.raises(CloudContentError) as caught:
        check_units(CLOUD * np.float32(factor))
    assert caught.value.suggestions == suggestions


@pytest.mark.parametrize("factor", [1, 0.1, 8])
def test_clouds_of_a_room_pass(factor: float) -> None:
    check_units(CLOUD * np.float32(factor))


def test_median_range() -> None:
    assert median_range_m(np.float32([[3, 4, 0], [0, 0, 1], [0, 0, 9]])) == 5.0
