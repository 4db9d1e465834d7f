# SPDX-License-Identifier: Apache-2.0
"""Ghost points of the simulated sensors: share, size and side of the surface."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.simulation.noise.ghosts import Ghosts, add_ghosts


def with_ghosts(ghosts: Ghosts, surface_m: float = 3.0) -> np.ndarray:
    return add_ghosts(np.full((120, 160), surface_m, np.float32), ghosts, np.random.default_rng(1))


@pytest.mark.parametrize("side_px", [1, 2, 5])
def test_squares_cover_the_share(side_px: int) -> None:
    moved = with_ghosts(Ghosts(share=0.02, side_px=side_px)) != 3.0
    assert 0.015 < moved.mean() <= 0.02  # squares overlap


def test_a_square_has_one_depth_at_the_edge_of_the_image_as_well() -> None:
    depth_m = add_ghosts(
        np.full((5, 5), 3.0, np.float32), Ghosts(share=0.9, side_px=5), np.random.default_rng(0)
    )
    assert len(np.unique(depth_m)) == 1


def test_ghosts_lie_on_the_side_that_is_asked_for_and_within_range() -> None:
    front = with_ghosts(Ghosts(share=0.05, side_px=2, towards="front"))
    behind = with_ghosts(Ghosts(share=0.05, side_px=2, towards="behind"))
    both = with_ghosts(Ghosts(share=0.05, side_px=2))
    assert front.max() == 3.0
    assert front.min() >= 0.4
    assert front[front < 3].max() <= 3 * 0.93 + 1e-6
    assert behind.min() == 3.0
    assert behind.max() <= 5.0
    assert both.min() < 3 < both.max()


def test_nothing_appears_where_nothing_was_measured_or_no_room_is_left() -> None:
    empty = np.full((20, 20), np.nan, np.float32)
    empty[:, 10:] = np.inf
    changed = add_ghosts(empty, Ghosts(share=0.5, side_px=2), np.random.default_rng(0))
    np.testing.assert_array_equal(changed, empty)
    far = with_ghosts(Ghosts(share=0.5, side_px=1, towards="behind"), surface_m=4.9)
    assert (far == np.float32(4.9)).all()
