# SPDX-License-Identifier: Apache-2.0
"""Poses of cameras: points of one camera in every frame are the same points in the body frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from doorstate.errors import CameraError
from doorstate.io.body_frame import points_in_body
from doorstate.io.options import ReadOptions
from doorstate.io.rotations import axes_matrix
from doorstate.io.sensor_pose import camera_pose
from doorstate.io.viewpoint import Viewpoint

# (N, 3) in the body frame, within a view ahead.
LEVEL = np.random.default_rng(7).uniform((0.5, -2, -1.5), (5, 2, 2), (50, 3))
AXES = st.sampled_from(["flu", "rdf", "rub", "luf", "bru", "dlf"])
TILTS_DEG = st.tuples(st.floats(-180, 180), st.floats(-75, 75))
HEADINGS_DEG = st.floats(-180, 180)
PLACES = st.tuples(*[st.floats(-1000, 1000)] * 3)


def seen(axes: str, roll_deg: float, pitch_deg: float) -> tuple[NDArray[np.float64], Rotation]:
    """Return the points as the tilted camera stores them, and R_level_stored."""
    tilt = Rotation.from_euler("ZYX", [0, pitch_deg, roll_deg], degrees=True)
    level_from_stored = tilt * Rotation.from_matrix(axes_matrix(axes))
    return level_from_stored.inv().apply(LEVEL), level_from_stored


@given(AXES, TILTS_DEG)
def test_axes_and_tilt_are_undone(axes: str, tilt_deg: tuple[float, float]) -> None:
    roll_deg, pitch_deg = tilt_deg
    stored, _ = seen(axes, roll_deg, pitch_deg)
    options = ReadOptions(axes=axes, roll_deg=roll_deg, pitch_deg=pitch_deg)
    points, pose = points_in_body(stored, options)
    np.testing.assert_allclose(points, LEVEL, atol=1e-5)
    np.testing.assert_allclose(pose.from_body(LEVEL), stored, atol=1e-9)


@given(AXES, TILTS_DEG, HEADINGS_DEG)
def test_a_quaternion_gives_the_tilt_whatever_the_heading(
    axes: str, tilt_deg: tuple[float, float], heading_deg: float
) -> None:
    stored, level_from_stored = seen(axes, *tilt_deg)
    map_from_stored = Rotation.from_euler("z", heading_deg, degrees=True) * level_from_stored
    quaternion = tuple(map_from_stored.as_quat().tolist())
    points, pose = points_in_body(stored, ReadOptions(axes=axes, quaternion=quaternion))
    np.testing.assert_allclose(points, LEVEL, atol=1e-4)
    assert (pose.axes, pose.axes_from, pose.tilt_from) == (axes, "given", "given")


@given(AXES, TILTS_DEG, HEADINGS_DEG, PLACES, st.sampled_from([1.0, 0.001]))
def test_points_in_a_map_come_back_to_the_camera(
    axes: str,
    tilt_deg: tuple[float, float],
    heading_deg: float,
    place: tuple[float, float, float],
    units_m: float,
) -> None:
    _, level_from_sensor = seen(axes, *tilt_deg)
    heading = Rotation.from_euler("z", heading_deg, degrees=True)
    in_map = heading.apply(LEVEL) / units_m + place
    viewpoint = Viewpoint(place, tuple((heading * level_from_sensor).as_quat().tolist()))
    options = ReadOptions(axes=axes, units_m=units_m)
    points, pose = points_in_body(in_map, options, viewpoint=viewpoint)
    np.testing.assert_allclose(points, LEVEL, atol=1e-4)
    np.testing.assert_allclose(pose.from_body(LEVEL), in_map * units_m, atol=1e-4)
    assert pose.tilt_from == "VIEWPOINT"
    np.testing.assert_allclose(
        Rotation.from_euler("ZYX", [0, pose.pitch_deg, pose.roll_deg], degrees=True).as_matrix(),
        Rotation.from_euler("ZYX", [0, *tilt_deg[::-1]], degrees=True).as_matrix(),
        atol=1e-6,
    )
    ignored = points_in_body(in_map, replace(options, ignore_viewpoint=True), viewpoint=viewpoint).points
    np.testing.assert_array_equal(ignored, points_in_body(in_map, options).points)


def test_a_given_tilt_takes_the_place_of_that_of_the_viewpoint() -> None:
    # The map is the tilted frame of an earlier image, 1 m behind: its z is not up.
    tilted, _ = seen("flu", 0, 20)
    viewpoint = Viewpoint((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    options = ReadOptions(pitch_deg=20)
    points, pose = points_in_body(tilted + np.array(viewpoint.position), options, viewpoint=viewpoint)
    np.testing.assert_allclose(points, LEVEL, atol=1e-5)
    assert (pose.tilt_from, pose.to_dict()["position_m"]) == ("given", [1.0, 0.0, 0.0])


def test_poses_that_cannot_be_meant_are_refused_with_a_way_out() -> None:
    optical = tuple(Rotation.from_matrix(axes_matrix("rdf")).as_quat().tolist())
    with pytest.raises(CameraError) as caught:
        points_in_body(LEVEL, ReadOptions(), viewpoint=Viewpoint((0.0, 0.0, 1.0), optical))
    assert caught.value.suggestions == {"axes": "optical"}
    with pytest.raises(CameraError) as caught:
        points_in_body(LEVEL, ReadOptions(quaternion=optical))
    assert caught.value.suggestions == {"axes": "optical"}
    points_in_body(LEVEL, ReadOptions(axes="ros"), viewpoint=Viewpoint((0.0, 0.0, 1.0), optical))
    for quaternion in ((0.0, 0.0, 0.0, 0.0), (0.0, 2**-0.5, 0.0, 2**-0.5)):  # no rotation; straight down
        with pytest.raises(CameraError) as caught:
            points_in_body(LEVEL, ReadOptions(), viewpoint=Viewpoint((1.0, 0.0, 0.0), quaternion))
        assert caught.value.suggestions == {"ignore_viewpoint": True}


def test_the_pose_is_plain_values() -> None:
    assert camera_pose("optical", 90, -0.0).to_dict() == {
        "axes": "rdf",
        "axes_from": "given",
        "roll_deg": 90,
        "pitch_deg": 0,
        "tilt_from": "given",
    }
    assert ReadOptions().pose("camera_optical_frame").axes_from == "frame_id"
    assert ReadOptions().pose("camera_link").axes_from == "assumed"
    assert ReadOptions(axes="ros").pose("camera_optical_frame").axes == "flu"
    assert ReadOptions(axes="ros").pose(is_depth=True).axes == "rdf"
