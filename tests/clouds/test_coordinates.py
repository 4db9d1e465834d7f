# SPDX-License-Identifier: Apache-2.0
"""Tests of doorstate.clouds.coordinates."""

from __future__ import annotations

import numpy as np

from doorstate.clouds.coordinates import coordinates


def test_coordinates_of_points_in_any_layout() -> None:
    image = np.arange(4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    for points in (image, image[::2, 1::2], image[0], image[0, :, ::-1], np.asfortranarray(image[1])):
        found = coordinates(points)
        assert found.flags.c_contiguous
        assert (points.reshape(-1, 3) == found.T).all()
        assert (coordinates(found.T) == found).all()
    assert coordinates(np.ones(3)).shape == (3, 1)
