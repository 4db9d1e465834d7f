# SPDX-License-Identifier: Apache-2.0
"""Poses of a camera: tables and trajectories, times between them, and lines that cannot be used."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.plane_pose import PlanePose
from doorstate.doors.pose_file import DEFAULTS, parse_place, read_poses
from doorstate.errors import DoorFileError


def write(folder: Path, text: str) -> Path:
    path = folder / "poses.csv"
    path.write_text(text)
    return path


def test_poses_between_two_lines_turn_the_short_way(tmp_path: Path) -> None:
    poses = read_poses(write(tmp_path, "time,x,y,yaw\n# turned\n2.0,1,0,-170\n1.5,0,2,170\n"))
    place = poses.at(1.75)
    assert isinstance(place, CameraPlace)
    assert place.pose == PlanePose(0.5, 1.0, 180.0)
    assert poses.at(1.5) == CameraPlace(PlanePose(0, 2, 170))
    for outside_s in (1.49, 2.01, math.nan):
        assert isinstance(poses.at(outside_s), MissingPlace)


def test_no_pose_in_a_gap_or_between_maps(tmp_path: Path) -> None:
    poses = read_poses(write(tmp_path, "time,x,y,yaw,frame\n1,0,0,0,up\n2.5,0,0,0,up\n3,0,0,0,down\n"))
    assert isinstance(poses.at(2.0), MissingPlace)
    assert isinstance(poses.at(2.7), MissingPlace)
    place = poses.at(3)
    assert isinstance(place, CameraPlace)
    assert place.frame == "down"


@pytest.mark.parametrize("axes", ["ros", "optical"])
def test_a_trajectory_gives_the_heading_of_a_tilted_camera(tmp_path: Path, axes: str) -> None:
    from scipy.spatial.transform import Rotation

    from doorstate.io.rotations import axes_matrix, parse_axes

    camera = Rotation.from_euler("ZYX", [30.0, 12.0, -4.0], degrees=True).as_matrix()
    stored = camera @ axes_matrix(parse_axes(axes))
    numbers = " ".join(f"{value:.9f}" for value in Rotation.from_matrix(stored).as_quat())
    poses = read_poses(write(tmp_path, f"# TUM\n7.5 1 -2 0.6 {numbers}\n"), DEFAULTS._replace(axes=axes))
    place = poses.at(7.5)
    assert isinstance(place, CameraPlace)
    assert place.pose == PlanePose(1.0, -2.0, pytest.approx(30.0, abs=1e-5))


def test_files_have_poses_by_the_end_of_their_path(tmp_path: Path) -> None:
    text = "file,time,x,y,yaw,position_error_m\na.pcd,,1,2,3,0.2\nb/a.pcd,5,4,5,6,\n"
    poses = read_poses(write(tmp_path, text), DEFAULTS._replace(yaw_error_deg=1.0))
    assert poses.of_file(Path("run/a.pcd")) == (None, CameraPlace(PlanePose(1, 2, 3), "map", 0.2, 1.0))
    stamp_s, place = poses.of_file(Path("/data/b/a.pcd"))
    assert (stamp_s, place) == (5.0, CameraPlace(PlanePose(4, 5, 6), "map", 0.1, 1.0))
    assert isinstance(poses.of_file(Path("c.pcd"))[1], MissingPlace)
    assert poses.at(5.0) == place


@pytest.mark.parametrize(
    ("text", "line", "field"),
    [
        ("", 0, None),
        ("x,y,yaw\n1,2,3\n", 1, None),
        ("time,x,y\n1,2,3\n", 1, None),
        ("time,time,x,y,yaw\n1,1,2,3,4\n", 1, None),
        ("time,x,y,yaw\n1,2,3\n", 2, None),
        ("time,x,y,yaw\n1,2,3,4\n2,nan,3,4\n", 3, "x"),
        ("time,x,y,yaw\n1,2,3,west\n", 2, "yaw"),
        ("time,x,y,yaw\n1,2e5,3,0\n", 2, "x"),
        ("time,x,y,yaw\n1,,3,0\n", 2, "x"),
        ("time,x,y,yaw\n,1,3,0\n", 2, "time"),
        ("time,x,y,yaw\n1,1,3,0\n1,2,3,0\n", 0, "time"),
        ("file,x,y,yaw\na,1,3,0\na,2,3,0\n", 3, "file"),
        ("time,x,y,yaw,yaw_error_deg\n1,1,3,0,-2\n", 2, "yaw_error_deg"),
        ("1 0 0 0 0 0 0 2\n", 1, "qx"),
        ("1 0 0 0 0 0 0\n", 1, None),
    ],
)
def test_a_line_that_cannot_be_used_is_named(tmp_path: Path, text: str, line: int, field: str | None) -> None:
    path = write(tmp_path, text)
    with pytest.raises(DoorFileError) as caught:
        read_poses(path)
    assert (caught.value.path, caught.value.field) == (path, field)
    assert (f"line {line}: " in caught.value.message) == (line > 0)


def test_one_pose_as_text() -> None:
    assert parse_place("1, 2 540").pose == PlanePose(1.0, 2.0, 180.0)
    for text in ("1 2", "1 2 x", "1 2 nan"):
        with pytest.raises(DoorFileError) as caught:
            parse_place(text)
        assert caught.value.field == "pose"
