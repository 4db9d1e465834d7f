# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.doorways.opening_surfaces on cells that are written down."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doorstate.doorways.opening_surfaces import floor_behind_share, is_across, is_flush

_ALONG_M = np.arange(1.0, 2.0, 0.1)  # an opening from 1 to 2 m beside the camera, 1 m before the wall
_ENDS_M = (0.95, 1.95)


def _relief_m(x_m: float) -> np.ndarray:
    """Return the depths at which the sight lines of the columns cross a plane across the wall."""
    return (x_m / _ALONG_M - 1)[:, None]


def test_far_jambs_and_leaves_at_the_near_jamb_are_across() -> None:
    jamb = is_across(_ALONG_M, _relief_m(1.95), 1.0, _ENDS_M)[:, 0]
    assert jamb[:-1].all()
    assert not jamb[-1]  # at the face of the wall
    leaf = is_across(_ALONG_M, _relief_m(0.95), 1.0, _ENDS_M)[:, 0]
    assert leaf[1:].all()
    mirrored = is_across(-_ALONG_M[::-1], _relief_m(1.95)[::-1], 1.0, (-_ENDS_M[1], -_ENDS_M[0]))[:, 0]
    assert (mirrored == jamb[::-1]).all()


@pytest.mark.parametrize("relief_m", [0.0, 0.02, math.nan])
def test_closed_leaves_and_gaps_are_not_across(relief_m: float) -> None:
    assert not is_across(_ALONG_M, np.full((10, 1), relief_m), 1.0, _ENDS_M).any()


def test_cells_at_the_middle_depth_are_flush() -> None:
    relief_m = np.array([[0.0], [0.03], [0.04], [0.05], [0.3], [np.nan]])
    rims = (np.array([True] + [False] * 5), np.array([False] * 6))
    in_view = np.ones((6, 1))
    assert is_flush(relief_m, in_view, rims)[:, 0].tolist() == [True, True, True, True, False, False]
    assert not is_flush(relief_m, 0 * in_view, rims).any()


def test_floor_behind_is_looked_for_where_it_is_in_range() -> None:
    to_plane_m = np.array([[2.0, 2.0], [2.1, 2.0]])
    heights_m = np.array([0.1, 0.3, 0.5, 1.5])  # 0.22, 0.86 and 2 m behind; never
    expected = np.full((2, 4), 8.0)
    through = np.array([[0.0, 8.0, 2.0, 8.0], [0.0, 4.0, 2.0, 8.0]])
    assert floor_behind_share(through, expected, to_plane_m, heights_m, 1.0, 9.0) == pytest.approx(16 / 32)
    assert floor_behind_share(through, expected, to_plane_m, heights_m, 1.0, 3.5) == pytest.approx(12 / 16)
    assert math.isnan(floor_behind_share(through, expected, to_plane_m, heights_m, 1.0, 2.5))
    assert math.isnan(floor_behind_share(through, expected / 9, to_plane_m, heights_m, 1.0, 3.5))
