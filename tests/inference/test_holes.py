# SPDX-License-Identifier: Apache-2.0
"""Holes like doorways have their width, height and distance; other holes do not."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.clouds.measured import is_measured
from doorstate.inference.gate import Gate
from doorstate.types import Points


def wall(distance_m: float = 3.0, hole_m: tuple[float, float] | None = None, height_m: float = 2.0) -> Points:
    """A wall across the view and a floor before it, (240, 320, 3), with a hole from the floor up."""
    across, up = np.meshgrid(np.linspace(0.58, -0.58, 320), np.linspace(0.43, -0.43, 240))
    depth_m = np.where(up < 0, np.minimum(distance_m, 1.0 / np.maximum(-up, 1e-9)), distance_m)
    if hole_m is not None:
        y_m, z_m = distance_m * across, distance_m * up
        depth_m[(y_m > hole_m[0]) & (y_m < hole_m[1]) & (z_m > -1) & (z_m < height_m - 1)] = np.nan
    return (depth_m[..., None] * np.stack((np.ones_like(up), across, up), axis=-1)).astype(np.float32)


def reason(cloud: Points) -> tuple[str, dict[str, float]]:
    abstention = Gate()(cloud)
    return ("", {}) if abstention is None else (abstention.code, dict(abstention.values))


@pytest.mark.parametrize("distance_m", [2.0, 3.5])
@pytest.mark.parametrize("height_m", [1.0, 2.0])
def test_a_dark_leaf_is_measured(distance_m: float, height_m: float) -> None:
    cloud = wall(distance_m, (-0.3, 0.6), height_m)
    for form in (cloud, cloud[is_measured(cloud)]):
        code, values = reason(form)
        assert code == "door_hole"
        assert values["width_m"] == pytest.approx(0.9, abs=0.2)
        seen_m = min(height_m, 1 + 0.43 * distance_m)
        assert values["height_m"] == pytest.approx(seen_m, abs=0.3)
        assert values["distance_m"] == pytest.approx(distance_m, abs=0.2)


@pytest.mark.parametrize("count", [500, 1000, 2000, 4000])
def test_flat_clouds_of_any_size_are_searched(count: int) -> None:
    rng = np.random.default_rng(0)
    dark, whole = (
        cloud[is_measured(cloud)][rng.permutation(is_measured(cloud).sum())[:count]]
        for cloud in (wall(2.5, (-0.5, 0.5)), wall(2.5))
    )
    assert reason(whole) == ("", {})
    code, values = reason(dark)
    assert code == "door_hole"
    assert values["width_m"] == pytest.approx(1.0, abs=0.45)  # cells reach into the hole


def test_missing_data_are_no_doorway() -> None:
    cloud = wall()
    edge, wide, whole_height = cloud.copy(), cloud.copy(), cloud.copy()
    edge[:, :80] = np.nan  # nothing beside it
    wide[40:200, 20:300] = np.nan  # 3 m
    whole_height[:, 100:130] = np.nan  # 0.3 m
    for holed in (edge, wide, whole_height):
        assert reason(holed)[0] == "hole"
