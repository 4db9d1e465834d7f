# SPDX-License-Identifier: Apache-2.0
"""Windows against SciPy's filters; correlated noise against its variance and correlation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from doorstate.simulation.noise.windows import (
    blobs,
    correlated_noise,
    enlarge,
    widen,
    window_mean,
    window_sum,
)

RNG = np.random.default_rng(3)
IMAGE = RNG.random((75, 41), dtype=np.float32)


@pytest.mark.parametrize("size", [1, 3, 5, 7, 9, 15])
def test_windows_equal_filters_of_scipy(size: int) -> None:
    mean = ndimage.uniform_filter(IMAGE.astype(np.float64), size, mode="nearest")
    np.testing.assert_allclose(window_mean(IMAGE, size), mean, atol=1e-6)
    mask = IMAGE > 0.98
    np.testing.assert_array_equal(widen(mask, size), ndimage.maximum_filter(mask, size, mode="constant"))
    assert window_sum(IMAGE, size).shape == (75 - size + 1, 41 - size + 1)


@pytest.mark.parametrize("size", [5, 9])
def test_correlated_noise_has_unit_variance_and_the_correlation_of_its_window(size: int) -> None:
    noise = correlated_noise((400, 500), size, np.random.default_rng(1)).astype(np.float64)
    assert noise.std() == pytest.approx(1, abs=0.05)
    for lag in (1, size // 2, size):
        for first, second in ((noise[:, lag:], noise[:, :-lag]), (noise[lag:], noise[:-lag])):
            assert np.mean(first * second) == pytest.approx(max(1 - lag / size, 0), abs=0.06)


def test_blobs_have_about_unit_variance() -> None:
    noise = blobs((480, 640), 7, np.random.default_rng(2))
    assert noise.shape == (480, 640)
    assert noise.dtype == np.float32
    assert noise.std() == pytest.approx(1, abs=0.1)
    assert np.corrcoef(noise[:, 3:].ravel(), noise[:, :-3].ravel())[0, 1] > 0.8


def test_enlarging_interpolates_linearly() -> None:
    row, column = np.mgrid[0:5, 0:6]
    plane = (2 * row + 3 * column).astype(np.float32)
    v, u = np.mgrid[0:12, 0:16]
    np.testing.assert_allclose(
        enlarge(plane, (12, 16), 4, [2, 1]), 2 * (v + 2) / 4 + 3 * (u + 1) / 4, rtol=1e-6
    )
