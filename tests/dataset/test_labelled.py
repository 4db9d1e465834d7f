# SPDX-License-Identifier: Apache-2.0
"""Labelled recordings: class folders, and an index with labels and cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.dataset.class_folders import label_of_folder
from doorstate.dataset.labelled import check_column, labelled_frames
from doorstate.errors import CameraError, CloudReadError, ConfigError, DatasetError
from doorstate.io.camera import Pinhole
from doorstate.io.find import INDEX_FILE
from doorstate.io.options import ReadOptions
from doorstate.types import NO_DOOR, STATES
from tests.error_fields import about

REAL = Path(__file__).resolve().parents[2].parent / "shared" / "real"
CLOUD = "1 2 3\n4 5 6\n"


@pytest.mark.parametrize(
    "name", ["none", "None", "no_door", "No Doors", "without a door", "no clear door", "02_no-door"]
)
def test_names_of_folders_without_a_door(name: str) -> None:
    assert label_of_folder(name) == "no_door"


@pytest.mark.parametrize("name", ["nones", "door", "north door", "doors", "", "nodding"])
def test_names_without_a_label(name: str) -> None:
    assert label_of_folder(name) is None


def write(root: Path, *names: str) -> Path:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(CLOUD, encoding="ascii")
    return root


def index(root: Path, text: str) -> Path:
    (root / INDEX_FILE).write_text(text, encoding="utf-8")
    return root


def test_labels_of_folders(tmp_path: Path) -> None:
    root = write(tmp_path, "open/a.xyz", "no door/b.xyz", "other/c.xyz", "closed/none/d.xyz")
    frames = labelled_frames(root)
    assert {(frame.file, frame.label) for frame in frames} == {
        ("open/a.xyz", "open"),
        ("no door/b.xyz", "no_door"),
        ("closed/none/d.xyz", "no_door"),
    }
    np.testing.assert_array_equal(frames[0].read().points, [[1, 2, 3], [4, 5, 6]])


def test_folders_without_labels_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="has no index"):
        labelled_frames(write(tmp_path, "cats/a.xyz"))
    with pytest.raises(DatasetError, check=about(tmp_path / "cats" / "a.xyz")):
        labelled_frames(tmp_path / "cats" / "a.xyz")
    (tmp_path / "empty").mkdir()
    with pytest.raises(CloudReadError, check=about(tmp_path / "empty")):
        labelled_frames(tmp_path / "empty")


def test_the_index_overrides_the_read_options_of_its_files(tmp_path: Path) -> None:
    pixels = np.full((4, 6), 800, np.uint16)
    for name in ("own.png", "all.png"):
        Image.fromarray(pixels).save(tmp_path / name)
    write(tmp_path, "optical.xyz")
    index(
        tmp_path,
        "file,state,door,fx,fy,cx,cy,width,height,depth_unit_m,axes,roll_deg\n"
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
    own, of_all, optical = (frame.read().points for frame in frames)
    np.testing.assert_allclose(own[0, 0], [2.0, 2 * 2.5 / 8, 2 * 1.5 / 8])
    np.testing.assert_allclose(of_all[0, 0], [0.8, -0.8 * 2.5 / 4, -0.8 * 1.5 / 4])
    np.testing.assert_allclose(optical[0], [3, -1, -2])


def test_an_image_of_another_size_than_in_the_index_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.ones((4, 6), np.uint16)).save(tmp_path / "a.png")
    index(tmp_path, "file,state,fx,fy,cx,cy,width,height\na.png,open,8,8,2,2,640,480\n")
    with pytest.raises(CameraError, match="6 x 4"):
        labelled_frames(tmp_path)[0].read()


@pytest.mark.parametrize(
    ("text", "error", "field"),
    [
        ("name,state\na.xyz,open\n", DatasetError, "file"),
        ("file,label\na.xyz,open\n", DatasetError, "state"),
        ("file,state\n", DatasetError, None),
        ("file,state\na.xyz,\n", DatasetError, "state"),
        ("file,state\n,open\n", DatasetError, "file"),
        ("file,state\na.xyz,open\na.xyz,open\n", DatasetError, "file"),
        ("file,state\nb.xyz,open\n", DatasetError, "file"),
        ("file,state,fx\na.xyz,open,8\n", DatasetError, "fy"),
        ("file,state,fx\na.xyz,open,wide\n", DatasetError, "fx"),
        ("file,state,roll_deg\na.xyz,open,nan\n", DatasetError, "roll_deg"),
        ("file,state,frame\na.xyz,open,optical\n", DatasetError, "frame"),
    ],
)
def test_an_invalid_index_is_refused_with_its_column(
    text: str, error: type[Exception], field: str | None, tmp_path: Path
) -> None:
    with pytest.raises(error) as refused:
        labelled_frames(index(write(tmp_path, "a.xyz"), text))
    assert (refused.value.path, refused.value.field) == (tmp_path / INDEX_FILE, field)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "text", ["file,state,depth_unit_m\na.xyz,open,0\n", "file,state,axes\na.xyz,open,map\n"]
)
def test_an_index_with_impossible_options_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(CameraError):
        labelled_frames(index(write(tmp_path, "a.xyz"), text))


def test_a_missing_column_is_refused(tmp_path: Path) -> None:
    frames = labelled_frames(index(write(tmp_path, "a.xyz"), "file,state,door,light\na.xyz,open,1,dim\n"))
    check_column(frames, "light")
    with pytest.raises(ConfigError, match="glass") as refused:
        check_column(frames, "glass")
    assert "door, light" in str(refused.value.hint)


@pytest.mark.skipif(not (REAL / INDEX_FILE).is_file(), reason="the recorded frames are not here")
def test_the_recorded_frames_can_be_read() -> None:
    frames = labelled_frames(REAL)
    labels = {frame.label for frame in frames}
    assert {*STATES, NO_DOOR} <= labels
    assert len({frame.file for frame in frames}) == len(frames)
    assert frames[0].read().points.shape[-1] == 3


def test_a_frame_tells_whether_its_tilt_is_known(tmp_path: Path) -> None:
    for name in "ab":
        np.savetxt(tmp_path / f"{name}.xyz", np.eye(3))
    index(tmp_path, "file,state,pitch_deg,camera_height_m\na.xyz,open,10,0.5\nb.xyz,open,,\n")
    tilted, unknown = (frame.read().pose for frame in labelled_frames(tmp_path))
    assert (tilted.is_tilt_known, tilted.pitch_deg, tilted.camera_height_m) == (True, 10, 0.5)
    assert not unknown.is_tilt_known
    assert unknown.camera_height_m is None
