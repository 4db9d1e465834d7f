# SPDX-License-Identifier: Apache-2.0
"""Rays that change from one cloud to the next."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.clouds.stillness import changed_rays, coarse_rays
from tests.hand_made_clouds import image_of_a_rough_wall

WALL = image_of_a_rough_wall(120, 160)


@pytest.mark.parametrize("is_image", [True, False])
def test_noise_is_no_change_and_a_step_is(is_image: bool) -> None:
    noisy = WALL * (1 + np.random.default_rng(0).normal(0, 0.003, (*WALL.shape[:2], 1))).astype(np.float32)
    nearer = WALL.copy()
    nearer[:, :40] *= 0.8
    clouds = [cloud if is_image else cloud.reshape(-1, 3) for cloud in (WALL, noisy, nearer)]
    first, second, third = map(coarse_rays, clouds)
    measured, changed = changed_rays(first, second)
    assert measured.sum() > 200
    assert changed.sum() == 0
    measured, changed = changed_rays(first, third)
    assert changed.sum() / measured.sum() == pytest.approx(0.25, abs=0.05)


def test_rays_without_a_measurement_do_not_count() -> None:
    hole = WALL.copy()
    hole[:60] = np.nan
    hole[60:, :80] = 0.0
    measured, changed = changed_rays(coarse_rays(WALL), coarse_rays(hole))
    assert measured.mean() == pytest.approx(0.25, abs=0.02)
    assert changed.sum() == 0


def test_images_of_other_sizes_share_no_ray() -> None:
    measured, changed = changed_rays(coarse_rays(WALL), coarse_rays(WALL[:100]))
    assert measured.sum() == changed.sum() == 0
    assert changed_rays(coarse_rays(WALL), coarse_rays(WALL.reshape(-1, 3)))[0].sum() == 0
