# SPDX-License-Identifier: Apache-2.0
"""Camera files of other tools."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics
from doorstate.io.camera_files import read_intrinsics
from doorstate.io.distortion import Distortion

RAW = Intrinsics(640, 480, 648.5, 649.5, 335.0, 255.0, Distortion("plumb_bob", (-0.36, 0.15, 5e-4, -2e-4, 0)))
RECTIFIED = Intrinsics(640, 480, 554.25, 555.25, 319.5, 239.5)

OPENCV = """%YAML:1.0
---
calibration_time: "Mon 30 Nov 2026 01:00:00 AM UTC"
image_width: 640
image_height: 480
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 6.4850000000000000e+02, 0., 335., 0., 6.4950000000000000e+02,
       255., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.36, 0.15, 5.0e-04, -2.0e-04, 0. ]
"""
KALIBR = """cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.36, 0.15, 0.0005, -0.0002]
  distortion_model: radtan
  intrinsics: [648.5, 649.5, 335.0, 255.0]
  resolution: [640, 480]
  rostopic: /camera/image_raw
"""
CAMERA_INFO = """image_width: 640
image_height: 480
camera_name: depth
camera_matrix: {rows: 3, cols: 3, data: [648.5, 0, 335, 0, 649.5, 255, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.36, 0.15, 0.0005, -0.0002, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [554.25, 0, 319.5, 0, 0, 555.25, 239.5, 0, 0, 0, 1, 0]}
"""
# ros2 topic echo: the driver does not know its camera yet in the first message, and the last one is cut off.
ECHO = """header: {stamp: {sec: 1, nanosec: 0}, frame_id: cam}
height: 480
width: 640
distortion_model: ''
d: []
k: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
p: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
---
height: 480
width: 640
distortion_model: plumb_bob
d: [-0.36, 0.15, 0.0005, -0.0002, 0.0]
k: [648.5, 0.0, 335.0, 0.0, 649.5, 255.0, 0.0, 0.0, 1.0]
p: [554.25, 0.0, 319.5, 0.0, 0.0, 555.25, 239.5, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
---
height: [
"""
OPEN3D = (
    '{"width": 640, "height": 480, "intrinsic_matrix": [554.25, 0, 0, 0, 555.25, 0, 319.5, 239.5, 1],'
    ' "depth_scale": 1000.0}'
)
REALSENSE = (
    '{"width": 640, "height": 480, "ppx": 335.0, "ppy": 255.0, "fx": 648.5, "fy": 649.5,'
    ' "model": "distortion.brown_conrady", "coeffs": [-0.36, 0.15, 0.0005, -0.0002, 0.0]}'
)
OPENCV_JSON = (
    '{"image_width": 640, "image_height": 480, "camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3,'
    ' "dt": "d", "data": [648.5, 0.0, 335.0, 0.0, 649.5, 255.0, 0.0, 0.0, 1.0]}, "distortion_coefficients":'
    ' {"type_id": "opencv-matrix", "rows": 5, "cols": 1, "dt": "d", "data": [-0.36, 0.15, 5e-4, -2e-4, 0.0]}}'
)


@pytest.mark.parametrize(
    ("name", "text", "rectified", "camera"),
    [
        ("opencv.yml", OPENCV, None, RAW),
        ("opencv5.yaml", OPENCV.replace("%YAML:1.0", "%YAML 1.0"), False, RAW),
        ("opencv.json", OPENCV_JSON, None, RAW),
        ("camchain.yaml", KALIBR, None, RAW),
        ("camera_info.yaml", CAMERA_INFO, None, RECTIFIED),
        ("camera_info.yaml", CAMERA_INFO, True, RECTIFIED),
        ("camera_info.yaml", CAMERA_INFO, False, RAW),
        ("echo.yaml", ECHO, None, RECTIFIED),
        ("echo.yaml", ECHO, False, RAW),
        ("open3d.json", OPEN3D, None, RECTIFIED),
        ("realsense.json", REALSENSE, None, RAW),
    ],
)
def test_files_of_other_tools(
    name: str, text: str, rectified: bool | None, camera: Intrinsics, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert read_intrinsics(tmp_path / name, rectified) == camera


def test_fisheye_cameras(tmp_path: Path) -> None:
    lens = Distortion("equidistant", (-0.36, 0.15, 0.0005, -0.0002))
    (tmp_path / "kalibr.yaml").write_text(KALIBR.replace("radtan", "equidistant"), encoding="utf-8")
    assert read_intrinsics(tmp_path / "kalibr.yaml").distortion == lens
    fisheye = OPENCV.replace("flags: 0", "fisheye_model: 1")
    (tmp_path / "opencv.yaml").write_text(fisheye, encoding="utf-8")
    assert read_intrinsics(tmp_path / "opencv.yaml").distortion == lens


@pytest.mark.parametrize(
    "text",
    [
        KALIBR + KALIBR.replace("cam0", "cam1"),
        KALIBR.replace("pinhole", "omni"),
        KALIBR.replace("resolution", "size"),
        KALIBR.replace("radtan", "fov"),
        ECHO.partition("---")[0],
        "!!opencv-matrix [1, 2]",
    ],
)
def test_what_cannot_be_a_camera_of_depth_images_is_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CameraError) as caught:
        read_intrinsics(path)
    assert caught.value.path == path
    assert str(caught.value).isprintable()
