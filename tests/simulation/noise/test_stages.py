# SPDX-License-Identifier: Apache-2.0
"""Stages of sensor models, one at a time, on depth images made by hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from doorstate.simulation.noise.axial import NguyenAxial, add_noise
from doorstate.simulation.noise.dropout import Grazing, Speckle, lose_grazing, lose_speckle
from doorstate.simulation.noise.edges import Edges, blur_edges
from doorstate.simulation.noise.lateral import Lateral, draw_moves
from doorstate.simulation.noise.materials import lose_patches
from doorstate.simulation.noise.quantisation import DepthSteps, DisparitySteps, round_depth, round_disparity
from doorstate.simulation.noise.shadow import SecondView, hide_from_second_view
from doorstate.simulation.noise.streams import sample_seed, stage_rng
from doorstate.simulation.render import Render
from doorstate.types import DepthImage

PROJECTOR, IMAGER = SecondView(baseline_m=0.075), SecondView(baseline_m=0.075, is_imager=True)
STEPS = DisparitySteps(baseline_m=0.075, step_px=1 / 8)
FOCAL_PX = 550.0
depths = npst.arrays(
    np.float32,
    npst.array_shapes(min_dims=2, max_dims=2, min_side=4, max_side=24),
    elements=st.floats(0.25, 8, width=32) | st.sampled_from([math.inf, math.nan]),
)


def zeros(depth_m: DepthImage) -> np.ndarray:
    return np.full(depth_m.shape, 1.4, np.float32)


STAGES: dict[str, Callable[[DepthImage, np.random.Generator], DepthImage]] = {
    "patches": lambda depth, rng: lose_patches(depth, zeros(depth) / 3, 2, rng),
    "projector": lambda depth, rng: hide_from_second_view(depth, PROJECTOR, FOCAL_PX),
    "imager": lambda depth, rng: hide_from_second_view(depth, IMAGER, FOCAL_PX),
    "downwards": lambda depth, rng: hide_from_second_view(
        depth, IMAGER.model_copy(update={"towards": "down"}), FOCAL_PX
    ),
    "disparity": lambda depth, rng: round_disparity(depth, STEPS, FOCAL_PX),
    "grazing": lambda depth, rng: lose_grazing(depth, zeros(depth), Grazing(), rng),
    "edges": lambda depth, rng: blur_edges(depth, depth, Edges(), rng),
    "speckle": lambda depth, rng: lose_speckle(depth, Speckle(share=0.2, side_px=3), rng),
    "depth steps": lambda depth, rng: round_depth(depth, DepthSteps(step_m=1 / 16, bits=8)),
}


@pytest.mark.parametrize("stage", STAGES.values(), ids=STAGES)
@given(depth_m=depths, seed=st.integers(0, 99))
@settings(max_examples=30)
def test_lost_pixels_stay_lost_and_the_input_is_unchanged(
    stage: Callable[[DepthImage, np.random.Generator], DepthImage], depth_m: DepthImage, seed: int
) -> None:
    before = depth_m.copy()
    after = stage(depth_m, stage_rng(seed, "test"))
    assert after.dtype == np.float32
    assert after.shape == depth_m.shape
    np.testing.assert_array_equal(depth_m, before)
    assert np.isnan(after[np.isnan(before)]).all()
    assert not np.isfinite(after[np.isinf(before)]).any()
    assert (after[np.isfinite(after)] > 0).all()
    np.testing.assert_array_equal(stage(depth_m, stage_rng(seed, "test")), after)


@given(row=st.lists(st.sampled_from([0.5, 0.8, 1.0, 1.5, 2.0, 3.1, 5.0, math.inf]), min_size=2, max_size=30))
@settings(max_examples=200)
def test_shadows_equal_a_loop_over_pairs_of_pixels(row: list[float]) -> None:
    depth_m = np.array([row, row[::-1]], np.float32)
    hidden = np.isnan(hide_from_second_view(depth_m, SecondView(baseline_m=0.01), 512.0))
    # In float32 as in the stage, so that both fall on the same side of a column's border.
    scale = np.float32(512.0 * 0.01)
    for line, lost in zip(depth_m, hidden, strict=True):
        disparity = scale / line
        column = np.floor(np.arange(len(line), dtype=np.float32) - disparity)
        expected = [
            min(
                max(
                    (float(d) for d, c in zip(disparity, column, strict=True) if c in (place - 1, place)),
                    default=0,
                )
                for place in (at, at + 1)
            )
            > own + np.float32(0.5)
            for own, at in zip(disparity, column, strict=True)
        ]
        assert lost.tolist() == expected


def test_a_thin_pole_casts_a_shadow_of_its_own_width() -> None:
    depth_m = np.full((3, 200), 3.0, np.float32)
    depth_m[:, 100:110] = 1.0
    lost = np.isnan(hide_from_second_view(depth_m, PROJECTOR, FOCAL_PX))
    # 27.5 px to the left: 550 x 0.075 (1 / 1 - 1 / 3).
    first, last = np.flatnonzero(lost[0])[[0, -1]]
    assert 71 <= first <= 73
    assert 81 <= last <= 83
    assert lost[0].sum() in (10, 11)
    assert (lost == lost[0]).all()


def test_a_plane_casts_no_shadow_on_itself() -> None:
    for slope in (-0.4, 0.0, 0.4, 2.0):
        u = np.arange(640, dtype=np.float32) - np.float32(319.7)
        plane = 1.5 / (1 + slope * u / FOCAL_PX)
        rendered = np.where((plane > 0.3) & (plane < 8), plane, np.inf).astype(np.float32)
        lost = np.isnan(hide_from_second_view(np.tile(rendered, (2, 1)), PROJECTOR, FOCAL_PX)[0])
        assert not lost[np.isfinite(rendered)].any()


def test_shadows_of_an_upright_camera_lie_above_the_object() -> None:
    depth_m = np.full((200, 6), 3.0, np.float32)
    depth_m[100:] = 1.0
    lost = np.isnan(hide_from_second_view(depth_m, SecondView(baseline_m=0.075, towards="down"), FOCAL_PX))
    np.testing.assert_array_equal(np.flatnonzero(lost[:, 0])[[0, -1]], [72, 99])


@given(depth_m=depths)
@settings(max_examples=50)
def test_rounding_disparity_moves_depth_by_at_most_half_a_step(depth_m: DepthImage) -> None:
    rounded = round_disparity(depth_m, STEPS, FOCAL_PX)
    finite = np.isfinite(rounded)
    apart_px = FOCAL_PX * 0.075 * np.abs(1 / depth_m[finite] - 1 / rounded[finite])
    assert (apart_px <= 1 / 16 + 1e-4).all()
    np.testing.assert_allclose(round_disparity(rounded, STEPS, FOCAL_PX), rounded, rtol=1e-6)


def test_an_8_bit_file_has_no_depth_below_half_a_step_or_beyond_its_bits() -> None:
    depth_m = np.array([[0.03, 0.04, 2.03, 2.04, 15.96, 15.98, np.inf, np.nan]], np.float32)
    kept = round_depth(depth_m, DepthSteps(step_m=1 / 16, bits=8))
    expected = [np.nan, 0.0625, 2.0, 2.0625, 15.9375, np.nan, np.nan, np.nan]
    np.testing.assert_array_equal(kept, np.array([expected], np.float32))


def test_pixels_beside_a_jump_are_lost_or_between_both_depths() -> None:
    depth_m = np.full((4000, 6), 2.0, np.float32)
    depth_m[:, 3:] = 2.5
    after = blur_edges(depth_m, depth_m, Edges(), stage_rng(1, "edges"))
    aside, beside = after[:, [0, 1, 4, 5]], after[:, 2:4]
    np.testing.assert_array_equal(aside, depth_m[:, [0, 1, 4, 5]])
    assert np.isnan(beside).mean() == pytest.approx(0.5, abs=0.02)
    left = beside[~np.isnan(beside)]
    between = (left > 2.0) & (left < 2.5)
    assert between.mean() == pytest.approx(0.1, abs=0.02)
    assert ((left >= 2.0) & (left <= 2.5)).all()
    # A jump of the measurements without one of the surfaces is noise.
    np.testing.assert_array_equal(
        blur_edges(depth_m, zeros(depth_m), Edges(lost=1), stage_rng(1, "edges")), depth_m
    )
    # Four per cent is no jump; a lost neighbour is no surface; the sky is a jump, but no pixel takes a depth between.
    flat = np.array([[2.0, 2.08, 2.0, np.nan, 2.5]], np.float32)
    np.testing.assert_array_equal(blur_edges(flat, flat, Edges(lost=1), stage_rng(0, "edges")), flat)
    sky = np.tile(np.array([[2.0, np.inf]], np.float32), (200, 1))
    torn = blur_edges(sky, sky, Edges(flying=1), stage_rng(0, "edges"))
    assert np.isinf(torn[:, 1]).all()
    assert set(np.unique(torn[:, 0][~np.isnan(torn[:, 0])]).tolist()) == {2.0}
    assert np.isnan(torn[:, 0]).mean() == pytest.approx(0.5, abs=0.12)


def test_measurements_move_only_between_surfaces_near_an_edge() -> None:
    box = np.zeros((2000, 40), np.int16)
    box[:, 20:] = 1
    depth_m = np.tile(np.linspace(1, 3, 40, dtype=np.float32), (2000, 1))
    depth_m[5, 19] = np.nan
    rendered = Render(depth_m, np.zeros(box.shape, np.uint8), box)
    targets, sources = draw_moves(
        rendered, np.zeros(box.shape, np.float32), Lateral(), stage_rng(3, "lateral")
    )
    # Beside the edge a normal deviate of 0.8 px reaches across it, by half a pixel, in 26.6 % of the pixels.
    assert np.isin(targets % 40, (19, 20)).sum() / 4000 == pytest.approx(0.266, abs=0.03)
    assert len(np.unique(targets)) == len(targets)
    assert (box.ravel()[targets] != box.ravel()[sources]).all()
    assert np.isin(targets % 40, range(17, 23)).all()
    assert np.abs(targets % 40 - sources % 40).max() <= 3
    assert 5 * 40 + 19 not in targets


def test_lateral_noise_grows_with_incidence_as_published() -> None:
    angle = np.radians(np.array([0.0, 45.0, 80.0], np.float32))
    np.testing.assert_allclose(Lateral().sigma_px(angle), [0.8, 0.835, 0.8 + 0.035 * 8], rtol=1e-5)


@pytest.mark.parametrize(
    ("depth_m", "angle_deg", "sigma_mm"),
    [
        (1, 0, 1.9),
        (2, 0, 6.1),
        (3, 0, 14.0),
        (3.5, 0, 19.5),
        (5, 0, 41.4),
        (1, 80, 1.884 + 6.4),
        (4, 75, 25.82 + 1.25),
    ],
)
def test_axial_noise_equals_the_published_table(depth_m: float, angle_deg: float, sigma_mm: float) -> None:
    depth, angle = np.array([[depth_m]], np.float32), np.radians(np.array([[angle_deg]], np.float32))
    sigma = 1000 * NguyenAxial().sigma_m(depth, angle, 0.0).item()
    assert sigma == pytest.approx(sigma_mm, abs=0.06)


def test_axial_noise_is_normal() -> None:
    noisy = add_noise(
        np.full((300, 400), 2, np.float32), np.full((300, 400), 0.01, np.float32), stage_rng(0, "axial")
    )
    error = (noisy - 2) / 0.01
    assert abs(error.mean()) < 0.02
    assert error.std() == pytest.approx(1, abs=0.01)
    assert (np.abs(error) < 1).mean() == pytest.approx(0.6827, abs=0.01)


def test_speckle_is_clustered() -> None:
    lost = np.isnan(
        lose_speckle(np.ones((400, 500), np.float32), Speckle(share=0.01, side_px=5), stage_rng(2, "s"))
    )
    assert lost.mean() == pytest.approx(0.01, rel=0.25)
    beside = lost[:, 1:][lost[:, :-1]].mean()
    assert beside > 0.7  # four of five pixels of a square have one to their right


def test_streams_of_samples_and_stages_are_independent() -> None:
    seeds = {
        sample_seed(seed, name) for seed in range(30) for name in ("p0000-closed", "p0000-open", "p0001-open")
    }
    assert len(seeds) == 90
    stages = ("materials", "lateral", "axial", "grazing", "edges", "speckle")
    draws = np.array([stage_rng(seed, stage).random(2000) for seed in (0, 1) for stage in stages])
    assert np.abs(np.corrcoef(draws) - np.eye(12)).max() < 0.12
    # numpy pads short seeds with zeros: [0] and [0, 0] are one stream, and none of ours equals it.
    plain = np.random.default_rng([0, 0]).random(2000)
    assert not any(np.array_equal(plain, stream) for stream in draws)
