# SPDX-License-Identifier: Apache-2.0
"""Augmentation keeps the state of the door: distances, angles and the vertical."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.spatial.distance import pdist

from doorstate.clouds.augmentation import Augmentation, apply_augmentation, draw_augmentation

POINTS = np.random.default_rng(0).normal(size=(6, 50, 3)).astype(np.float32)
seeds = st.integers(0, 2**32 - 1)


def augmented(augmentation: Augmentation, seed: int = 0) -> NDArray[np.float32]:
    draw = draw_augmentation(augmentation, np.random.default_rng(seed), *POINTS.shape[:2])
    return apply_augmentation(POINTS, draw)


def linear_of(augmentation: Augmentation, seed: int = 0, clouds: int = 300) -> NDArray[np.float32]:
    return draw_augmentation(augmentation, np.random.default_rng(seed), clouds, 1).linear


def angles(points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the angle at the second of each three successive points."""
    one, other = points[:, :-2] - points[:, 1:-1], points[:, 2:] - points[:, 1:-1]
    lengths = np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1)
    return np.arccos(np.clip((one * other).sum(axis=-1) / lengths, -1, 1)).astype(np.float64)


def handedness(points: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.sign(np.linalg.det(points[:, :3].astype(np.float64)))


def test_defaults_change_nothing() -> None:
    changed = augmented(Augmentation())
    assert changed.dtype == np.float32
    np.testing.assert_array_equal(changed, POINTS)


@given(seed=seeds)
@settings(max_examples=20)
def test_yaw_keeps_heights_distances_and_handedness(seed: int) -> None:
    changed = augmented(Augmentation(yaw_deg=180), seed)
    np.testing.assert_array_equal(changed[..., 2], POINTS[..., 2])
    for before, after in zip(POINTS, changed, strict=True):
        np.testing.assert_allclose(pdist(after), pdist(before), rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(handedness(changed), handedness(POINTS))
    assert np.abs(changed - POINTS).max() > 0.01


def test_rotations_are_rotations_within_their_range() -> None:
    linear = linear_of(Augmentation(yaw_deg=30)).astype(np.float64)
    np.testing.assert_allclose(linear @ linear.transpose(0, 2, 1), np.tile(np.eye(3), (300, 1, 1)), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(linear), 1, atol=1e-6)
    yaw_deg = np.degrees(np.arctan2(linear[:, 1, 0], linear[:, 0, 0]))
    assert np.abs(yaw_deg).max() <= 30.001
    assert yaw_deg.min() < -25
    assert yaw_deg.max() > 25


def test_a_tilt_is_small_and_a_rotation() -> None:
    linear = linear_of(Augmentation(tilt_deg=2), clouds=3000).astype(np.float64)
    np.testing.assert_allclose(np.linalg.det(linear), 1, atol=1e-6)
    up_deg = np.degrees(np.arccos(np.clip(linear[:, 2, 2], -1, 1)))
    # R_x(a) R_y(b) takes up to (sin b, -sin a cos b, cos a cos b); both are cut at three sigma.
    about_y = np.degrees(np.arcsin(linear[:, 0, 2]))
    about_x = np.degrees(np.arctan2(-linear[:, 1, 2], linear[:, 2, 2]))
    assert np.abs(about_x).max() == pytest.approx(6, abs=1e-3)
    assert np.abs(about_y).max() == pytest.approx(6, abs=1e-3)
    # The tilt about two axes of sigma 2 degrees is Rayleigh distributed: its mean is 2 sqrt(pi / 2).
    assert up_deg.mean() == pytest.approx(2 * math.sqrt(math.pi / 2), rel=0.05)


@given(seed=seeds)
@settings(max_examples=20)
def test_scale_keeps_angles_and_so_the_doors(seed: int) -> None:
    changed = augmented(Augmentation(scale=(0.5, 2.0)), seed)
    np.testing.assert_allclose(angles(changed), angles(POINTS), atol=2e-3)
    factor = changed[:, 0, 0] / POINTS[:, 0, 0]
    assert ((factor > 0.499) & (factor < 2.001)).all()
    assert np.ptp(factor) > 0.01  # each cloud its own


def test_a_scale_of_the_height_alone_keeps_angles_seen_from_above() -> None:
    changed = augmented(Augmentation(scale_z=(0.8, 0.9)))
    np.testing.assert_array_equal(changed[..., :2], POINTS[..., :2])
    ratio = changed[..., 2] / POINTS[..., 2]
    assert 0.799 < ratio.min() <= ratio.max() < 0.901


def test_a_mirror_flips_left_and_right_with_its_probability() -> None:
    changed = augmented(Augmentation(mirror=1.0))
    np.testing.assert_array_equal(changed, POINTS * np.array([1, -1, 1], np.float32))
    np.testing.assert_array_equal(handedness(changed), -handedness(POINTS))
    mirrored = np.linalg.det(linear_of(Augmentation(mirror=0.3), clouds=2000)) < 0
    assert mirrored.mean() == pytest.approx(0.3, abs=0.04)


def test_jitter_is_clipped_and_a_shift_moves_whole_clouds() -> None:
    jitter = augmented(Augmentation(jitter=0.02, jitter_clip=0.03)) - POINTS
    assert 0.0299 < np.abs(jitter).max() <= 0.03 + 1e-6
    assert jitter.std() == pytest.approx(0.0175, abs=0.002)  # N(0, 0.02) cut at 1.5 sigma
    shift = augmented(Augmentation(shift=0.2)) - POINTS
    assert np.ptp(shift, axis=1).max() < 1e-6
    assert 0.05 < np.abs(shift).max() <= 0.2 + 1e-6


@given(seed=seeds)
@settings(max_examples=10)
def test_a_seed_draws_the_same_again(seed: int) -> None:
    everything = Augmentation(
        yaw_deg=90, mirror=0.5, scale=(0.8, 1.2), scale_z=(0.9, 1.1), shift=0.1, tilt_deg=3, jitter=0.01
    )
    np.testing.assert_array_equal(augmented(everything, seed), augmented(everything, seed))
    assert (augmented(everything, seed) != augmented(everything, seed + 1)).any()


@pytest.mark.parametrize(
    "wrong",
    [{"yaw_deg": 181}, {"mirror": 1.5}, {"jitter": -1}, {"shift": -0.1}, {"tilt": 3}, {"scale": (1.0,)}],
)
def test_impossible_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        Augmentation.model_validate(wrong)


@pytest.mark.parametrize(
    ("augmentation", "similar", "rigid"),
    [
        (Augmentation(), True, True),
        (Augmentation(yaw_deg=90, mirror=0.5, shift=1, tilt_deg=5), True, True),
        (Augmentation(scale=(0.9, 1.1)), True, False),
        (Augmentation(scale_z=(1.0, 1.0)), False, False),
        (Augmentation(jitter=0.001), False, False),
    ],
)
def test_rigid_and_similar_augmentations(augmentation: Augmentation, similar: bool, rigid: bool) -> None:
    assert (augmentation.is_similarity, augmentation.is_rigid) == (similar, rigid)
