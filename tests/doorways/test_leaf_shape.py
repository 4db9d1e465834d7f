# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.leaf_shape on surfaces that are written down."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.doorways.doorway import Doorway
from doorstate.doorways.leaf_shape import find_leaf_angle_deg
from doorstate.doorways.leaf_sweep import SeenLeaf
from doorstate.doorways.measured_view import MeasuredView

_DOORWAY = Doorway(2.5, -0.4, 90.0, 0.9, -1.0)
_LEAF = SeenLeaf(1.0, 85.0, "right", "towards", 0.9)


def _surface(
    angle_deg: float, height_m: float = 2.0, high_m: float = 0.0, deep_m: float = 0.0
) -> MeasuredView:
    """Return a leaf with its hinge on the right, lower but for its first `high_m`, scattered by `deep_m`."""
    along, up = np.meshgrid(np.arange(0.02, 0.9, 0.02), np.arange(0.02, 2.0, 0.04))
    along, up = along.ravel(), up.ravel()
    is_there = (up < height_m) | (along < high_m)
    along, up = along[is_there], up[is_there]
    off = deep_m * np.random.default_rng(0).uniform(-1, 1, len(along))
    turn = np.radians(angle_deg)
    x = -0.45 + along * np.cos(turn) + off * np.sin(turn)
    y = along * np.sin(turn) - off * np.cos(turn)
    return MeasuredView(_DOORWAY.to_sensor(np.stack([x, y, up], axis=-1).astype(np.float32)))


@pytest.mark.parametrize("angle_deg", [76.0, 85.0, 94.0])
def test_the_angle_of_a_leaf_is_measured(angle_deg: float) -> None:
    assert find_leaf_angle_deg(_surface(angle_deg), _DOORWAY, _LEAF) == pytest.approx(angle_deg, abs=0.5)


@pytest.mark.parametrize(
    "view",
    [
        _surface(65.0),  # another way
        _surface(85.0, height_m=1.0, high_m=0.4),  # narrower above, as people and plants are
        _surface(85.0, deep_m=0.15),
        _surface(5.0),  # a wall
    ],
)
def test_what_is_no_flat_rectangle_is_no_leaf(view: MeasuredView) -> None:
    assert find_leaf_angle_deg(view, _DOORWAY, _LEAF) is None
