# SPDX-License-Identifier: Apache-2.0
"""Poses that come while a camera moves: the newest counts for half a second, and no old one as new."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from doorstate.doors.camera_place import CameraPlace, MissingPlace
from doorstate.doors.pose_file import DEFAULTS
from doorstate.doors.pose_stream import MAX_AGE_S, STANDARD_INPUT, PoseStream
from doorstate.errors import DoorFileError
from tests.waiting import wait_until


def place_at(poses: PoseStream, stamp_s: float) -> tuple[float, float, float]:
    place = poses.at(stamp_s)
    assert isinstance(place, CameraPlace), place
    return tuple(place.pose)


def reason_at(poses: PoseStream, stamp_s: float) -> str:
    place = poses.at(stamp_s)
    assert isinstance(place, MissingPlace)
    return place.reason


def test_a_pose_lies_between_two_and_the_newest_lasts_half_a_second() -> None:
    poses = PoseStream(STANDARD_INPUT)
    assert reason_at(poses, 1.0)
    for number, line in enumerate(["# from a localisation", "time,x,y,yaw", "10.0,1,2,90", "10.2,2,2,92"], 1):
        poses.add(line, number)
    assert place_at(poses, 10.1) == pytest.approx((1.5, 2.0, 91.0))
    assert place_at(poses, 10.2 + MAX_AGE_S - 0.01) == (2.0, 2.0, 92.0)
    assert "1.8 s" in reason_at(poses, 12.0)
    assert reason_at(poses, 9.0)


def test_lines_of_a_trajectory_with_the_errors_that_were_given() -> None:
    poses = PoseStream(STANDARD_INPUT, DEFAULTS._replace(position_error_m=0.3, frame="hall"))
    poses.add("5.0 1 2 0.5 0 0 0 1", 1)
    place = poses.at(5.1)
    assert isinstance(place, CameraPlace)
    assert (place.frame, place.position_error_m) == ("hall", 0.3)


def test_a_line_that_is_no_pose_is_told_until_a_good_one_follows() -> None:
    poses = PoseStream(STANDARD_INPUT)
    poses.add("time,x,y,yaw", 1)
    poses.add("1.0,0,0,0", 2)
    poses.add("1.1,zero,0,0", 3)
    assert "line 3" in reason_at(poses, 1.1)
    poses.add("1.2,0,0,0", 4)
    assert place_at(poses, 1.2) == (0.0, 0.0, 0.0)


def test_poses_of_before_a_clock_that_is_set_back_are_forgotten() -> None:
    poses = PoseStream(STANDARD_INPUT)
    for number, stamp_s in enumerate((1000.0, 1000.1, 500.0), 1):
        poses.add(f"{stamp_s} {number} 0 0 0 0 0 1", number)
    assert place_at(poses, 500.1)[0] == 3.0
    assert reason_at(poses, 1000.0)


def test_a_file_that_grows_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("time,x,y,yaw\n1.0,1,0,0\n1.1,2", encoding="utf-8")
    with PoseStream(path) as poses, path.open("a", encoding="utf-8") as stream:
        wait_until(lambda: isinstance(poses.at(1.0), CameraPlace))
        assert place_at(poses, 1.1) == (1.0, 0.0, 0.0), "the second line is not whole yet"
        stream.write(",0,0\n")
        stream.flush()
        wait_until(lambda: place_at(poses, 1.1)[0] == 2.0)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_that_ends_leaves_poses_that_grow_old(tmp_path: Path) -> None:
    path = tmp_path / "poses"
    os.mkfifo(path)
    with PoseStream(path) as poses:
        path.write_text("1.0 1 0 0 0 0 0 1\n", encoding="utf-8")
        wait_until(lambda: isinstance(poses.at(1.2), CameraPlace))
        assert isinstance(poses.at(2.0), MissingPlace)


def test_a_file_that_is_not_there_or_no_text_is_told(tmp_path: Path) -> None:
    with pytest.raises(DoorFileError), PoseStream(tmp_path / "absent.csv"):
        pass
    with pytest.raises(DoorFileError):
        PoseStream(STANDARD_INPUT, DEFAULTS._replace(axes="sideways"))
    path = tmp_path / "poses.csv"
    path.write_bytes(b"\xff\xfe\x00 1\n")
    with PoseStream(path) as poses:
        wait_until(lambda: "cannot be read" in reason_at(poses, 1.0))
