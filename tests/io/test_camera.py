# SPDX-License-Identifier: Apache-2.0
"""Intrinsics: the numbers that are refused, and every file form that gives the same camera."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics, read_intrinsics
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
    "broken.json": ('{"width": 640,', "not a JSON or YAML"),
    "unsafe.yaml": ("!!python/object/apply:os.getcwd []", "not a JSON or YAML"),
    "half.json": ('{"width": 640, "height": 480, "fx": 600}', "lacks fy, cx, cy"),
    "short.json": ('{"width": 640, "height": 480, "K": [1, 2, 3, 4]}', "nine numbers"),
    "words.json": ('{"width": "wide", "height": 480, "fx": 1, "fy": 1, "cx": 1, "cy": 1}', "not a JSON"),
    "half_pixel.json": (
        '{"width": 640.5, "height": 480, "fx": 1, "fy": 1, "cx": 1, "cy": 1}',
        "whole pixels",
    ),
    # Nine lines of merges would be a billion entries.
    "merged.yaml": ("{a: &a {fx: 1}, b: {<<: [*a, *a]}}", "refers to itself"),
    "long.json": (" " * 40_000, "larger than 32 KiB"),
    "digits.json": (
        '{"width": "1%s", "height": 480, "fx": 1, "fy": 1, "cx": 1, "cy": 1}' % ("0" * 2000),
        "image size inf x 480 is not in whole pixels$",
    ),
    # ROS publishes a zero matrix for a camera nobody calibrated.
    "zero.yaml": ("{width: 640, height: 480, k: [0, 0, 0, 0, 0, 0, 0, 0, 0]}", "calibrated"),
}


def test_from_hfov_is_the_gazebo_formula() -> None:
    camera = Intrinsics.from_hfov(640, 480, math.radians(60))
    assert camera.fx == camera.fy == pytest.approx(320 / math.tan(math.radians(30)))
    assert (camera.width, camera.height, camera.cx, camera.cy) == (640, 480, 319.5, 239.5)


@given(st.integers(1, 4000), st.integers(1, 4000), st.floats(0.1, 3.0))
@settings(deadline=None, max_examples=50)
def test_from_hfov_spans_the_field_of_view(width: int, height: int, hfov_rad: float) -> None:
    camera = Intrinsics.from_hfov(width, height, hfov_rad)
    # From the outer edge of the first pixel to the outer edge of the last one.
    left, right = (-0.5 - camera.cx) / camera.fx, (width - 0.5 - camera.cx) / camera.fx
    assert math.atan(right) - math.atan(left) == pytest.approx(hfov_rad)


@pytest.mark.parametrize("hfov_rad", [0.0, -1.0, math.pi, math.nan])
def test_an_impossible_field_of_view_is_refused(hfov_rad: float) -> None:
    with pytest.raises(CameraError, match="field of view"):
        Intrinsics.from_hfov(640, 480, hfov_rad)


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


def test_another_image_size_is_refused_with_both_sizes() -> None:
    CAMERA.check_image_size(640, 480)
    with pytest.raises(CameraError, match=r"848 x 480 .* 640 x 480"):
        CAMERA.check_image_size(848, 480)


@pytest.mark.parametrize("name", FILES)
def test_every_form_gives_the_same_camera(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(FILES[name], encoding="utf-8")
    assert read_intrinsics(tmp_path / name) == CAMERA


def test_of_a_long_recorded_topic_the_beginning_is_read(tmp_path: Path) -> None:
    path = tmp_path / "echo.yaml"
    path.write_text(FILES["echo2.yml"] * 500, encoding="utf-8")
    assert read_intrinsics(path) == CAMERA


@pytest.mark.parametrize("name", BAD_FILES)
def test_a_bad_file_gives_one_line_that_starts_with_its_name(tmp_path: Path, name: str) -> None:
    text, reason = BAD_FILES[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(CameraError, match=reason) as caught:
        read_intrinsics(tmp_path / name)
    assert str(caught.value).startswith(f"{name}: ")
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_camera_errors(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.json", tmp_path):
        with pytest.raises(CameraError, match=path.name):
            read_intrinsics(path)


_JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=9)
        | st.dictionaries(st.sampled_from(["width", "height", "fx", "fy", "cx", "cy", "K", "data"]), inner)
    ),
    max_leaves=15,
)


@given(st.one_of(st.binary(max_size=80), _JSON.map(lambda value: json.dumps(value).encode())))
@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_are_intrinsics_or_a_camera_error(tmp_path: Path, data: bytes) -> None:
    for name in ("fuzz.json", "fuzz.yaml"):
        (tmp_path / name).write_bytes(data)
        outcome = _camera_or_error(tmp_path / name)
        if isinstance(outcome, Intrinsics):
            assert outcome.fx > 0
        else:
            assert str(outcome).startswith(name)
            assert "\n" not in str(outcome)


def _camera_or_error(path: Path) -> Intrinsics | CameraError:
    try:
        return read_intrinsics(path)
    except CameraError as error:
        return error


def test_intrinsics_of_the_turned_image_see_the_same_rays() -> None:
    camera = Intrinsics(7, 5, 4.0, 3.0, 2.5, 2.2)
    depth_m = np.random.default_rng(0).uniform(1, 3, (5, 7))
    turned = depth_to_points(np.rot90(depth_m, -1), camera.turned_clockwise())
    np.testing.assert_allclose(turned, np.rot90(depth_to_points(depth_m, camera, roll_deg=90), -1), rtol=1e-6)
