# SPDX-License-Identifier: Apache-2.0
"""VIEWPOINT in the headers of PCD files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate.io.options import ReadOptions
from doorstate.io.readers import read_posed_cloud
from doorstate.io.viewpoint import Viewpoint, read_viewpoint

HEADER = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT {}\nPOINTS 2\n"
POINTS = "DATA ascii\n3 4 0.5\n3 6 0.5\n"


@pytest.mark.parametrize(
    ("text", "viewpoint"),
    [
        ("0 0 0 1 0 0 0", None),
        ("0 0 0 0 0 0 0", None),
        ("1 2 0.5 0.5 -0.5 0.5 -0.5", Viewpoint((1, 2, 0.5), (-0.5, 0.5, -0.5, 0.5))),
        ("0 0 0 0 0 0 1", Viewpoint((0, 0, 0), (0, 0, 1, 0))),
    ],
)
def test_the_identity_is_none(text: str, viewpoint: Viewpoint | None) -> None:
    assert read_viewpoint((HEADER.format(text) + POINTS).encode()) == viewpoint


def test_points_are_read_as_the_camera_saw_them(tmp_path: Path) -> None:
    # At (3, 2, 1) in the map, looking along its y.
    path = tmp_path / "map.pcd"
    path.write_text(HEADER.format("3 2 1 0.70710678 0 0 0.70710678") + POINTS)
    cloud, pose = read_posed_cloud(path)
    np.testing.assert_allclose(cloud, [[2, 0, -0.5], [4, 0, -0.5]], atol=1e-6)
    assert pose.to_dict()["position_m"] == [3, 2, 1]
    stored, pose = read_posed_cloud(path, ReadOptions(ignore_viewpoint=True))
    np.testing.assert_array_equal(stored, [[3, 4, 0.5], [3, 6, 0.5]])
    assert "position_m" not in pose.to_dict()
