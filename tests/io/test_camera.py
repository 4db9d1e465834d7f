# SPDX-License-Identifier: Apache-2.0
"""Intrinsics: impossible numbers, and camera files in all supported forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics, Pinhole, pinhole_from_numbers
from doorstate.io.camera_files import read_intrinsics
from doorstate.io.depth import depth_to_points

CAMERA = Intrinsics(640, 480, 617.25, 617.5, 317.25, 245.75)

FILES = {
    "plain.json": '{"width": 640, "height": 480, "fx": 617.25, "fy": 617.5, "cx": 317.25, "cy": 245.75}',
    "realsense.json": '{"width": 640, "height": 480, "ppx": 317.25, "ppy": 245.75, "fx": 617.25, '
    '"fy": 617.5, "model": "distortion.inverse_brown_conrady", "coeffs": [0, 0, 0, 0, 0]}',
    "matrix.json": '{"width": 640, "height": 480, "K": [617.25, 0, 317.25, 0, 617.5, 245.75, 0, 0, 1]}',
    "nested.JSON": '{"width": 640, "height": 480, "k": [[617.25, 0, 317.25], [0, 617.5, 245.75], [0, 0, 1]]}',
    "bom.json": '\ufeff{"width": 640, "height": 480, "K": [617.25, 0, 317.25, 0, 617.5, 245.75, 0, 0, 1]}',
    # camera_calibration's file (also ROS 2's camera_info_manager)
    "calibration.yaml": """image_width: 640
image_height: 480
camera_name: depth
camera_matrix:
  rows: 3
  cols: 3
  data: [617.25, 0., 317.25, 0., 617.5, 245.75, 0., 0., 1.]
distortion_model: plumb_bob
""",
    # rostopic echo, ROS 1
    "echo1.yaml": """header:
  seq: 12
  stamp: {secs: 1, nsecs: 2}
  frame_id: "depth_optical_frame"
height: 480
width: 640
distortion_model: "plumb_bob"
D: [0.0, 0.0, 0.0, 0.0, 0.0]
K: [617.25, 0.0, 317.25, 0.0, 617.5, 245.75, 0.0, 0.0, 1.0]
---
header:
  seq: 13
  stamp: cut off here [
""",
    # ros2 topic echo
    "echo2.yml": """---
height: 480
width: 640
k:
- 617.25
- 0.0
- 317.25
- 0.0
- 617.5
- 245.75
- 0.0
- 0.0
- 1.0
---
""",
}

BAD_FILES = {
    "empty.yaml": ("", "no intrinsics"),
    "list.json": ("[1, 2]", "no intrinsics"),
    "broken.json": ('{"width": 640,', "not a JSON"),
    "unsafe.yaml": ("!!python/object/apply:os.getcwd []", "not a JSON"),
    "half.json": ('{"width": 640, "height": 480, "fx": 600}', "lacks fy, cx, cy"),
    "short.json": ('{"width": 640, "height": 480, "K": [1, 2, 3, 4]}', "4 numbers"),
    "words.json": ('{"width": "wide", "height": 480, "fx": 1, "fy": 1, "cx": 1, "cy": 1}', "not a number"),
    "half_pixel.json": (
        '{"width": 640.5, "height": 480, "fx": 1, "fy": 1, "cx": 1, "cy": 1}',
        "whole pixels",
    ),
    # Nine lines of merges would be a billion entries.
    "merged.yaml": ("{a: &a {fx: 1}, b: {<<: [*a, *a]}}", "refers to itself"),
    "long.json": (" " * 40_000, "larger than 32 KiB"),
    "digits.json": (
        '{"width": "1%s", "height": 480, "fx": 1, "fy": 1, "cx": 1, "cy": 1}' % ("0" * 2000),
        "inf x 480",
    ),
    # ROS publishes a zero matrix for an uncalibrated camera.
    "zero.yaml": ("{width: 640, height: 480, k: [0, 0, 0, 0, 0, 0, 0, 0, 0]}", "calibrated"),
}


def test_from_hfov_is_the_gazebo_formula() -> None:
    camera = Intrinsics.from_hfov(640, 480, math.radians(60))
    assert camera.fx == camera.fy == pytest.approx(320 / math.tan(math.radians(30)))
    assert (camera.width, camera.height, camera.cx, camera.cy) == (640, 480, 319.5, 239.5)


@given(st.integers(1, 2896), st.integers(1, 2896), st.floats(0.1, 3.0))
@settings(max_examples=50)
def test_from_hfov_spans_the_field_of_view(width: int, height: int, hfov_rad: float) -> None:
    camera = Intrinsics.from_hfov(width, height, hfov_rad)
    # From the outer edge of the first pixel to the outer edge of the last one.
    left, right = (-0.5 - camera.cx) / camera.fx, (width - 0.5 - camera.cx) / camera.fx
    assert math.atan(right) - math.atan(left) == pytest.approx(hfov_rad)


@pytest.mark.parametrize("hfov_rad", [0.0, -1.0, math.pi, math.nan])
def test_an_impossible_field_of_view_is_refused(hfov_rad: float) -> None:
    with pytest.raises(CameraError) as caught:
        Intrinsics.from_hfov(640, 480, hfov_rad)
    assert caught.value.field == "hfov_rad"


@pytest.mark.parametrize(
    ("width", "height", "fx", "fy", "cx", "cy"),
    [
        (0, 480, 600, 600, 320, 240),
        (640, -1, 600, 600, 320, 240),
        (640, 480, 0, 600, 320, 240),
        (640, 480, 600, -600, 320, 240),
        (640, 480, math.nan, 600, 320, 240),
        (640, 480, 600, math.inf, 320, 240),
        (640, 480, 600, 600, math.nan, 240),
        (640, 480, 600, 600, 320, math.inf),
    ],
)
def test_impossible_numbers_are_refused(
    width: int, height: int, fx: float, fy: float, cx: float, cy: float
) -> None:
    with pytest.raises(CameraError):
        Intrinsics(width, height, fx, fy, cx, cy)


def test_another_image_size_is_refused() -> None:
    CAMERA.check_image_size(640, 480)
    with pytest.raises(CameraError, match=r"848 x 480 .* 640 x 480"):
        CAMERA.check_image_size(848, 480)


@pytest.mark.parametrize("name", FILES)
def test_every_form_gives_the_same_camera(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(FILES[name], encoding="utf-8")
    assert read_intrinsics(tmp_path / name) == CAMERA


def test_the_first_document_of_a_long_recorded_topic_is_read(tmp_path: Path) -> None:
    path = tmp_path / "echo.yaml"
    path.write_text(FILES["echo2.yml"] * 500, encoding="utf-8")
    assert read_intrinsics(path) == CAMERA


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files_are_camera_errors(tmp_path: Path, name: str) -> None:
    text, reason = BAD_FILES[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(CameraError, match=reason) as caught:
        read_intrinsics(tmp_path / name)
    assert caught.value.path == tmp_path / name
    assert str(caught.value).isprintable()


def test_a_missing_file_and_a_folder_are_camera_errors(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.json", tmp_path):
        with pytest.raises(CameraError, match=path.name):
            read_intrinsics(path)


def test_pinhole_from_numbers() -> None:
    assert pinhole_from_numbers(1, 2, 3, 4) == Pinhole(1, 2, 3, 4)
    assert pinhole_from_numbers(None, None, None, None) is None
    with pytest.raises(CameraError) as caught:
        pinhole_from_numbers(1, 2, None, 4)
    assert caught.value.field == "cx"


def test_intrinsics_of_the_turned_image_see_the_same_rays() -> None:
    camera = Intrinsics(7, 5, 4.0, 3.0, 2.5, 2.2)
    depth_m = np.random.default_rng(0).uniform(1, 3, (5, 7))
    turned = depth_to_points(np.rot90(depth_m, -1), camera.turned_clockwise())
    np.testing.assert_allclose(turned, np.rot90(depth_to_points(depth_m, camera, roll_deg=90), -1), rtol=1e-6)
