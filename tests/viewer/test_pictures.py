# SPDX-License-Identifier: Apache-2.0
"""Pictures of organized clouds, and where points are in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.viewer.depth_picture import colour_picture, depth_picture, relief_picture
from doorstate.viewer.picture_projection import fit_projection

CAMERA = Intrinsics(160, 120, 140.0, 135.0, 75.0, 62.0)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 0), (3, 25), (90, -10)])
def test_projection_is_that_of_the_camera(roll_deg: float, pitch_deg: float) -> None:
    depth_m = np.random.default_rng(0).uniform(1, 4, (120, 160))
    points = depth_to_points(depth_m, CAMERA, roll_deg, pitch_deg)
    points[:, :30] = np.nan
    matrix = fit_projection(points)
    assert matrix is not None
    sample = points[10::37, 31::41].reshape(-1, 3)
    projected = sample @ matrix.T
    assert (projected[:, 2] > 0).all()
    rows, columns = np.mgrid[10:120:37, 31:160:41]
    assert projected[:, 0] / projected[:, 2] == pytest.approx(columns.reshape(-1), abs=0.05)
    assert projected[:, 1] / projected[:, 2] == pytest.approx(rows.reshape(-1), abs=0.05)


def test_points_of_a_plane_are_enough_and_other_images_have_no_projection() -> None:
    assert fit_projection(depth_to_points(np.full((120, 160), 2.0), CAMERA)) is not None
    shuffled = np.random.default_rng(0).permutation(
        depth_to_points(np.full((120, 160), 2.0), CAMERA).reshape(-1, 3)
    )
    assert fit_projection(shuffled.reshape(120, 160, 3)) is None
    assert fit_projection(np.full((120, 160, 3), np.nan, np.float32)) is None


def test_relief_shows_a_recess_and_no_noise() -> None:
    depth_m = np.full((120, 160), 3.0)
    depth_m[30:, 50:90] = 3.08
    noisy_m = depth_m + np.random.default_rng(0).normal(0, 0.01, depth_m.shape)
    for image in (depth_m, noisy_m):
        points = depth_to_points(image, CAMERA)
        darker = (depth_picture(points).astype(int) - relief_picture(points)).max(axis=2) > 20
        assert darker[40:110, 48:53].any(axis=1).mean() > 0.9
        assert darker[40:110, 60:80].mean() < 0.05
        assert darker[5:25].mean() < 0.05
    assert depth_picture(np.full((4, 5, 3), np.nan, np.float32)).tolist() == [[[70, 70, 70]] * 5] * 4
    assert relief_picture(np.full((4, 5, 3), np.nan, np.float32)).max() == 70


def test_a_damaged_colour_image_is_none(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    assert colour_picture(path) is None
    path.write_bytes(b"\x89PNG")
    assert colour_picture(path) is None
    Image.new("RGB", (4, 3), (1, 2, 3)).save(path)
    assert np.asarray(colour_picture(path)).tolist() == [[[1, 2, 3]] * 4] * 3
