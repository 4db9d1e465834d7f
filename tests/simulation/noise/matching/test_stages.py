# SPDX-License-Identifier: Apache-2.0
"""Stages of matching: overlap against a loop, fattened edges, holes, wrong planes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.simulation.noise.matching.fattening import average, fatten, find_edges
from doorstate.simulation.noise.matching.holes import Holes, lose_at_edges, lose_weak
from doorstate.simulation.noise.matching.mismatches import Mismatches, mismatch
from doorstate.simulation.noise.matching.overlap import lacks_overlap

DISPARITIES = st.lists(st.sampled_from([0.0, 3.0, 4.25, 7.5, 12.0]), min_size=2, max_size=30)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def step_image() -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """A near surface of disparity 20 in the right half, a far one of 10 in the left half."""
    return np.where(np.arange(80) < 40, np.float32(10), np.float32(20)) * np.ones((60, 1), np.float32)


@given(row=DISPARITIES)
@settings(max_examples=200)
def test_overlap_equals_a_loop_over_pairs_of_pixels(row: list[float]) -> None:
    disparity = np.array([row], np.float32)
    hidden = lacks_overlap(disparity, has_band=True)[0]
    for here, own in enumerate(row):
        passed = any(there - other + 0.5 < here - own for there, other in enumerate(row) if there > here)
        assert hidden[here] == (passed or (here - own < -0.5 and own > 0))


def test_the_shadow_of_an_edge_is_as_wide_as_the_difference_of_disparities() -> None:
    hidden = lacks_overlap(step_image(), has_band=False)
    assert hidden.sum(axis=1) == pytest.approx(10, abs=1)
    assert hidden[:, 30:40].sum() == hidden.sum()


def test_the_nearer_surface_grows_by_up_to_half_a_window() -> None:
    disparity = step_image()
    edges = find_edges(disparity, 7, 1.0)
    assert (edges == edges[0]).all()
    assert np.flatnonzero(edges[0]).tolist() == list(range(37, 44))
    moves = fatten(disparity, edges, 3, 1.0, rng())
    grown = disparity.copy()
    grown.ravel()[moves.targets] = disparity.ravel()[moves.sources]
    width = (grown == 20).sum(axis=1) - 40
    assert (width.min(), width.max()) == (0, 3)
    assert set(np.unique(grown).tolist()) == {10.0, 20.0}


def test_relief_below_a_jump_is_smoothed_and_edges_are_kept() -> None:
    shallow = step_image() / np.float32(20)
    edges = find_edges(shallow, 9, 1.0)
    assert not edges.any()
    smooth = average(shallow, edges, 9)
    assert 0.5 < smooth[30, 39] < smooth[30, 40] < 1.0
    steep = step_image()
    edges = find_edges(steep, 9, 1.0)
    np.testing.assert_allclose(average(steep, edges, 9), steep, rtol=1e-6)


def test_holes_grow_as_contrast_falls_and_have_the_size_of_windows() -> None:
    shares = []
    for contrast in (3.0, 1.5, 1.0, 0.5, 0.0):
        lost = lose_weak(np.full((240, 320), contrast, np.float32), Holes(), 7, rng())
        shares.append(lost.mean())
        if contrast == 1.0:
            assert lost[:, 1:][lost[:, :-1]].mean() > 0.85
    assert shares == sorted(shares)
    assert shares[0] < 0.001
    assert shares[2] == pytest.approx(0.5, abs=0.1)
    assert shares[-1] > 0.95


def test_windows_across_an_edge_are_lost_with_their_share() -> None:
    edges = np.zeros((300, 300), np.bool_)
    edges[:, 100:200] = True
    lost = lose_at_edges(edges, Holes(edge_lost=0.25), rng())
    assert not lost[~edges].any()
    assert lost[edges].mean() == pytest.approx(0.25, abs=0.03)


def test_wrong_planes_are_patches_and_rare_where_contrast_is_high() -> None:
    changed = []
    for contrast in (1.0, 5.0):
        disparity = np.full((240, 320), 10, np.float32)
        mismatch(disparity, np.full((240, 320), contrast, np.float32), 60.0, Mismatches(share=0.05), rng())
        assert (disparity >= -60).all()
        changed.append((disparity != 10).mean())
    assert changed[0] == pytest.approx(0.05, abs=0.025)
    assert changed[1] < changed[0] / 4
