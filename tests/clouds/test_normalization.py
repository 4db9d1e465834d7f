# SPDX-License-Identifier: Apache-2.0
"""Normalised clouds: centre, scale, batches."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.clouds.normalization import normalize


@given(seed=st.integers(0, 2**32 - 1), offset=st.floats(-20, 20))
@settings(max_examples=30)
def test_clouds_are_centred_and_in_units_of_three_metres(seed: int, offset: float) -> None:
    points = np.random.default_rng(seed).uniform(0.5, 4.0, (200, 3)).astype(np.float32) + np.float32(offset)
    normalized = normalize(np.stack([points, points * 2]))
    assert normalized.dtype == np.float32
    assert np.abs(normalized.mean(axis=1, dtype=np.float64)).max() < 1e-6
    np.testing.assert_allclose(normalized[0] * 3, points - points.mean(axis=0, dtype=np.float64), atol=1e-5)
    np.testing.assert_array_equal(normalized[1], normalize(points * 2))
