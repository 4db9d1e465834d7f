# SPDX-License-Identifier: Apache-2.0
"""Frames of real cameras, read with the intrinsics and units of index.csv."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from doorstate.errors import CloudReadError
from doorstate.io.camera import Intrinsics
from doorstate.io.find import find_clouds
from doorstate.io.options import ReadOptions
from doorstate.io.readers import read_cloud

REAL = Path(__file__).resolve().parents[2].parent / "shared" / "real"
pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the recorded frames are not here")


def _rows() -> list[dict[str, str]]:
    with (REAL / "index.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_frame_is_metres_of_a_room() -> None:
    rows = [row for row in _rows() if row["fx"] != "?" and "8bit" not in row["file"]]
    assert rows
    for row in rows:
        numbers = [float(row[name]) for name in ("fx", "fy", "cx", "cy") if row[name]]
        camera = Intrinsics(int(row["width"]), int(row["height"]), *numbers) if numbers else None
        options = ReadOptions(intrinsics=camera, depth_scale_m=float(row["depth_unit_m"] or 1))
        points = read_cloud(REAL / row["file"], options)
        assert points.shape[-1] == 3
        if camera:
            assert points.shape == (camera.height, camera.width, 3)
        range_m = np.linalg.norm(points, axis=-1)
        assert 0.3 < np.nanmedian(range_m) < 10, row["file"]
        assert np.isfinite(range_m).mean() > 0.25, row["file"]
        if camera:
            assert np.nanmin(points[..., 0]) > 0


def test_arrays_of_an_unknown_camera_are_read_with_a_similar_one() -> None:
    camera = Intrinsics.from_hfov(640, 360, np.deg2rad(87))  # D435 datasheet: 87 degrees of depth
    for row in _rows():
        if row["fx"] == "?":
            points = read_cloud(REAL / row["file"], ReadOptions(intrinsics=camera))
            assert 0.3 < np.nanmedian(points[..., 0]) < 10
            assert np.nanmax(points[..., 0]) < 65.5


def test_the_8_bit_image_and_the_colour_image_are_refused() -> None:
    with pytest.raises(CloudReadError, match="256 depth steps"):
        read_cloud(REAL / "kinect2_8bit_01_open.png")
    with pytest.raises(CloudReadError, match="colour image"):
        read_cloud(REAL / "tauzn_01_closed_rgb.png")


def test_colour_images_are_not_listed() -> None:
    names = {path.name for path in find_clouds([REAL])}
    assert {row["file"] for row in _rows()} <= names
    assert not any("_rgb" in name for name in names)
