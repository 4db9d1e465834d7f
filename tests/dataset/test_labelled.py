# SPDX-License-Identifier: Apache-2.0
"""Labelled recordings: folders, an index that says how each file is read, and one line for what is wrong with it."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.dataset.class_folders import label_of_folder
from doorstate.dataset.labelled import INDEX, check_column, labelled_frames
from doorstate.errors import CameraError, CloudReadError, ConfigError, DatasetError
from doorstate.io.camera import Pinhole
from doorstate.io.options import ReadOptions

REAL = Path(__file__).resolve().parents[2].parent / "shared" / "real"
CLOUD = "1 2 3\n4 5 6\n"


@pytest.mark.parametrize(
    "name", ["none", "None", "no_door", "No Doors", "without a door", "no clear door", "02_no-door"]
)
def test_folders_without_a_door(name: str) -> None:
    assert label_of_folder(name) == "no_door"


@pytest.mark.parametrize("name", ["nones", "door", "north door", "doors", "", "nodding"])
def test_other_folders_mean_nothing(name: str) -> None:
    assert label_of_folder(name) is None


def write(root: Path, *names: str) -> Path:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(CLOUD, encoding="ascii")
    return root


def index(root: Path, text: str) -> Path:
    (root / INDEX).write_text(text, encoding="utf-8")
    return root


def test_folders_name_the_labels(tmp_path: Path) -> None:
    root = write(tmp_path, "open/a.xyz", "no door/b.xyz", "other/c.xyz", "closed/none/d.xyz")
    frames = labelled_frames(root)
    assert {(frame.file, frame.label) for frame in frames} == {
        ("open/a.xyz", "open"),
        ("no door/b.xyz", "no_door"),
        ("closed/none/d.xyz", "no_door"),
    }
    np.testing.assert_array_equal(frames[0].read(), [[1, 2, 3], [4, 5, 6]])


def test_folders_without_labels_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"has no index\.csv, and no clouds in folders named after states"):
        labelled_frames(write(tmp_path, "cats/a.xyz"))
    with pytest.raises(DatasetError, match="is not a folder"):
        labelled_frames(tmp_path / "cats" / "a.xyz")
    (tmp_path / "empty").mkdir()
    with pytest.raises(CloudReadError, match="no clouds in this folder"):
        labelled_frames(tmp_path / "empty")


def test_the_index_says_how_each_file_is_read(tmp_path: Path) -> None:
    pixels = np.full((4, 6), 800, np.uint16)
    for name in ("own.png", "all.png"):
        Image.fromarray(pixels).save(tmp_path / name)
    write(tmp_path, "optical.xyz")
    index(
        tmp_path,
        "file,state,door,fx,fy,cx,cy,width,height,depth_unit_m,frame,roll_deg\n"
        "own.png,Half open,kitchen,8,8,2.5,1.5,6,4,0.0025,,\n"
        "all.png,none,,?,?,?,?,6,4,,,180\n"
        "optical.xyz,openings,hall,,,,,,,,optical,\n",
    )
    frames = labelled_frames(tmp_path, ReadOptions(intrinsics=Pinhole(4, 4, 2.5, 1.5)))
    assert [(frame.label, frame.columns["door"]) for frame in frames] == [
        ("semi_open", "kitchen"),
        ("no_door", ""),
        ("openings", "hall"),
    ]
    assert "state" not in frames[0].columns
    own, of_all, optical = (frame.read() for frame in frames)
    np.testing.assert_allclose(own[0, 0], [2.0, 2 * 2.5 / 8, 2 * 1.5 / 8])
    np.testing.assert_allclose(of_all[0, 0], [0.8, -0.8 * 2.5 / 4, -0.8 * 1.5 / 4])
    np.testing.assert_allclose(optical[0], [3, -1, -2])


def test_an_image_of_another_size_than_the_index_says_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.ones((4, 6), np.uint16)).save(tmp_path / "a.png")
    index(tmp_path, "file,state,fx,fy,cx,cy,width,height\na.png,open,8,8,2,2,640,480\n")
    with pytest.raises(CameraError, match=r"the image has 6 x 4 pixels"):
        labelled_frames(tmp_path)[0].read()


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("name,state\na.xyz,open\n", DatasetError, "has no column 'file', only name, state"),
        ("file,label\na.xyz,open\n", DatasetError, "has no column 'state', only file, label"),
        ("file,state\n", DatasetError, "has no lines"),
        ("file,state\na.xyz,\n", DatasetError, "line 2 has no value in column 'state'"),
        ("file,state\n,open\n", DatasetError, "line 2 has no value in column 'file'"),
        ("file,state\na.xyz,open\na.xyz,open\n", DatasetError, "line 3 names 'a.xyz' a second time"),
        ("file,state\nb.xyz,open\n", DatasetError, "line 2 names 'b.xyz', which is not in the folder"),
        ("file,state,fx\na.xyz,open,8\n", DatasetError, "line 2 lacks fy, cx, cy: .* belong together"),
        ("file,state,fx\na.xyz,open,wide\n", DatasetError, "line 2, column fx: 'wide' is no number"),
        (
            "file,state,roll_deg\na.xyz,open,nan\n",
            DatasetError,
            "line 2, column roll_deg: 'nan' is no number",
        ),
        ("file,state,depth_unit_m\na.xyz,open,0\n", CameraError, "metres per unit is impossible"),
        ("file,state,frame\na.xyz,open,map\n", CameraError, "map"),
    ],
)
def test_an_index_that_cannot_be_used_is_refused_in_one_line(
    text: str, error: type[Exception], message: str, tmp_path: Path
) -> None:
    with pytest.raises(error, match=message) as caught:
        labelled_frames(index(write(tmp_path, "a.xyz"), text))
    assert "\n" not in str(caught.value)


def test_columns_that_are_not_there_are_named(tmp_path: Path) -> None:
    frames = labelled_frames(index(write(tmp_path, "a.xyz"), "file,state,door,light\na.xyz,open,1,dim\n"))
    check_column(frames, "light")
    with pytest.raises(ConfigError, match="no column 'glass'; there are: door, light"):
        check_column(frames, "glass")


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded frames are not here")
def test_the_recorded_frames_have_an_index() -> None:
    frames = labelled_frames(REAL)
    assert Counter(frame.label for frame in frames) == {
        "closed": 13,
        "semi_open": 2,
        "open": 2,
        "no_door": 9,
        "openings": 1,
    }
    assert frames[0].read().shape == (480, 640, 3)
