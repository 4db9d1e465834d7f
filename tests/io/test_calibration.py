# SPDX-License-Identifier: Apache-2.0
"""One rule for the numbers of a camera, in files, bags and topics."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from doorstate.errors import CameraError
from doorstate.io.calibration import (
    Calibration,
    calibration_from_mapping,
    calibration_from_message,
    is_rectified,
)
from doorstate.io.camera import Intrinsics
from doorstate.io.distortion import Distortion

K = (648.0, 0, 335, 0, 649, 255, 0, 0, 1)
P = (554.0, 0, 319.5, 0, 0, 555, 239.5, 0, 0, 0, 1, 0)
D = (-0.36, 0.15, 0.0005, -0.0002, 0.0)
BOTH = Calibration(640, 480, K, P, "plumb_bob", D)
RECTIFIED = Intrinsics(640, 480, 554, 555, 319.5, 239.5)
RAW = Intrinsics(640, 480, 648, 649, 335, 255, Distortion("plumb_bob", D))


@pytest.mark.parametrize(
    ("calibration", "rectified", "camera"),
    [
        (BOTH, None, RECTIFIED),
        (BOTH, True, RECTIFIED),
        (BOTH, False, RAW),
        (Calibration(640, 480, K, [0.0] * 12, "plumb_bob", D), None, RAW),
        (Calibration(640, 480, K, None, "plumb_bob", D), False, RAW),
        (Calibration(640, 480, K, None, "plumb_bob", D), True, Intrinsics(640, 480, 648, 649, 335, 255)),
        (Calibration(640, 480, [0.0] * 9, P), False, RECTIFIED),
    ],
)
def test_rectified_images_have_p_and_others_k(
    calibration: Calibration, rectified: bool | None, camera: Intrinsics
) -> None:
    assert calibration.camera(rectified) == camera


@pytest.mark.parametrize(
    ("topic", "rectified"),
    [
        ("/camera/depth/image_rect_raw", True),
        ("/camera/depth/image_rect_raw/compressedDepth", True),
        ("/camera/depth/image_raw/compressedDepth", False),
        ("/camera/aligned_depth_to_color/image_raw", False),
        ("/zed/depth/depth_registered", None),
        ("/rectified/depth/image", None),
    ],
)
def test_topics_of_image_proc_tell(topic: str, rectified: bool | None) -> None:
    assert is_rectified(topic) is rectified


def test_regions_are_cut_and_pixels_binned_in_the_order_of_image_geometry() -> None:
    full = Calibration(640, 480, K, P, binning=(2, 4), region=(100, 40, 400, 400))
    assert full.camera() == Intrinsics(200, 100, 277, 138.75, 109.75, 49.875)
    assert full.camera(False) == Intrinsics(200, 100, 324, 162.25, 117.5, 53.75)
    assert Calibration(640, 480, K, P, binning=(0, 0)).camera() == RECTIFIED
    with pytest.raises(CameraError, match="whole pixels"):
        Calibration(641, 480, K, P, binning=(2, 2)).camera()


def test_messages_of_both_versions_of_ros_and_their_files_are_the_same() -> None:
    region = {"x_offset": 0, "y_offset": 0, "width": 320, "height": 480, "do_rectify": False}
    common: dict[str, Any] = {"width": 640, "height": 480, "distortion_model": "plumb_bob", "binning_x": 2}
    common |= {"binning_y": 0}
    expected = Calibration(640, 480, [*K], [*P], "plumb_bob", [*D], (2, 0), (0, 0, 320, 480))
    for names in ("kpd", "KPD"):
        numbers = dict(zip(names, (K, P, D), strict=True))
        message = SimpleNamespace(**common, **numbers, roi=SimpleNamespace(**region))
        assert calibration_from_message(message) == expected
        lists = {name: list(value) for name, value in numbers.items()}
        assert calibration_from_mapping(common | lists | {"roi": region}) == expected


@pytest.mark.parametrize(
    "calibration",
    [
        Calibration(640, 480, [0.0] * 9, [0.0] * 12),
        Calibration(640, 480),
        Calibration(640, 480, K[:8]),
        Calibration(640, 480, K, P[:9]),
        Calibration(640, 480, K, None, "fov", D),
        Calibration(640, 0, K),
        Calibration(640, 480, (float("nan"), *K[1:])),
    ],
)
def test_what_is_no_calibration_is_refused(calibration: Calibration) -> None:
    with pytest.raises(CameraError):
        calibration.camera()


@pytest.mark.parametrize(
    "entries",
    [
        {},
        {"width": 640, "height": 480},
        {"width": 640, "height": 480, "fx": 1, "fy": 1, "cx": 1},
        {"width": 640, "height": 480, "k": list(K), "roi": {"x_offset": -1}},
        {"width": 640, "height": 480, "k": list(K), "binning_x": 0.5},
        {"width": 640, "height": 480, "k": [[1, 2], "x"]},
        {"width": 640, "height": 480, "intrinsic_matrix": [1, 2, 3]},
    ],
)
def test_entries_that_are_no_calibration_are_refused(entries: dict[str, Any]) -> None:
    with pytest.raises(CameraError):
        calibration_from_mapping(entries).camera()
