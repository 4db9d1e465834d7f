# SPDX-License-Identifier: Apache-2.0
"""Read options of files from the index beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.dataset.frame_index import IndexedOptions, read_index
from doorstate.doorways.doorway import Doorway
from doorstate.errors import CameraError, DatasetError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.options import ReadOptions

HEADER = "file,fx,fy,cx,cy,width,height,depth_unit_m,axes,roll_deg,pitch_deg,quaternion\n"


def write(folder: Path, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "index.csv").write_text(text, encoding="utf-8")
    return folder


def test_lines_change_the_options_of_their_files_alone(tmp_path: Path) -> None:
    given = ReadOptions(intrinsics=Pinhole(1, 1, 1, 1), pitch_deg=3, units_m=0.001)
    write(
        tmp_path,
        HEADER
        + "a.png,500,501,320,240,640,480,0.00025,?,,20,\n"
        + "Depth/Test/b.png,500,501,320,240,,,,,90,,\n"
        + "c.pcd,,,,,,,,opengl,,,\n"
        + "d.pcd,,,,,,,,,,,0 0 0 1\n",
    )
    indexed = IndexedOptions(given)
    assert indexed.of(tmp_path / "a.png") == ReadOptions(
        intrinsics=Intrinsics(640, 480, 500, 501, 320, 240),
        depth_scale_m=0.00025,
        pitch_deg=20,
        units_m=0.001,
    )
    below = indexed.of(tmp_path / "Depth" / "Test" / "b.png")
    assert (below.intrinsics, below.roll_deg, below.pitch_deg) == (Pinhole(500, 501, 320, 240), 90, 3)
    assert indexed.of(tmp_path / "c.pcd").axes == "opengl"
    assert indexed.of(tmp_path / "d.pcd").quaternion == (0, 0, 0, 1)
    assert indexed.of(tmp_path / "d.pcd").pitch_deg is None
    assert indexed.of(tmp_path / "e.pcd") is given
    assert indexed.of(tmp_path / "1" / "2" / "3" / "a.png") is given


def test_the_nearest_index_with_the_file_counts(tmp_path: Path) -> None:
    write(tmp_path, "file,pitch_deg\nsub/a.pcd,1\nsub/b.pcd,2\n")
    write(tmp_path / "sub", "file,pitch_deg\na.pcd,10\n")
    indexed = IndexedOptions(ReadOptions())
    assert indexed.of(tmp_path / "sub" / "a.pcd").pitch_deg == 10
    assert indexed.of(tmp_path / "sub" / "b.pcd").pitch_deg == 2
    assert indexed.of(tmp_path / "sub" / ".." / "sub" / "b.pcd").pitch_deg == 2


@pytest.mark.parametrize(
    ("line", "error", "field"),
    [
        ("../a.png,,,,,,,,,,,", DatasetError, "file"),
        ("/a.png,,,,,,,,,,,", DatasetError, "file"),
        ("sub/../../a.png,,,,,,,,,,,", DatasetError, "file"),
        (",,,,,,,,,,,", DatasetError, "file"),
        ("a.png,8,,,,,,,,,,", DatasetError, "fy"),
        ("a.png,8,8,2,2,640.5,480,,,,,", DatasetError, "width"),
        ("a.png,0,8,2,2,,,,,,,", CameraError, "fx"),
        ("a.png,,,,,,,0,,,,", CameraError, "depth_scale_m"),
        ("a.png,,,,,,,,map,,,", CameraError, "axes"),
        ("a.png,,,,,,,,,,91,", CameraError, "pitch_deg"),
        ("a.png,,,,,,,,,,,0 0 1", CameraError, "quaternion"),
    ],
)
def test_a_line_that_cannot_be_meant_is_an_error_with_its_number(
    line: str, error: type[DatasetError | CameraError], field: str, tmp_path: Path
) -> None:
    folder = write(tmp_path / "folder", HEADER + line + "\n")
    (tmp_path / "a.png").touch()
    with pytest.raises(error, match="line 2") as caught:
        IndexedOptions(ReadOptions()).of(folder / "a.png")
    assert (caught.value.path, caught.value.field) == (folder / "index.csv", field)


def test_colour_images_outside_are_refused(tmp_path: Path) -> None:
    folder = write(tmp_path / "folder", "file,state,rgb\na.png,open,../secret.png\n")
    (folder / "a.png").touch()
    (tmp_path / "secret.png").touch()
    with pytest.raises(DatasetError) as caught:
        read_index(folder, ReadOptions())
    assert caught.value.field == "rgb"


def test_lines_with_places_share_a_file_and_those_without_a_state_are_left_out(tmp_path: Path) -> None:
    header = "file,state,door_x_m,door_y_m,door_yaw_deg,door_width_m,door_floor_z_m\n"
    folder = write(
        tmp_path, header + "a.pcd,open,2,0.5,90,0.9,-1\na.pcd,closed,2,-1,90,0.8,-1\nb.pcd,,,,,,\n"
    )
    (folder / "a.pcd").touch()
    lines = read_index(folder, ReadOptions())
    assert [line.doorway for line in lines] == [Doorway(2, 0.5, 90, 0.9, -1), Doorway(2, -1, 90, 0.8, -1)]
    write(tmp_path, header + "a.pcd,open,2,0.5,90,0.9,-1\na.pcd,closed,,,,,\n")
    with pytest.raises(DatasetError) as raised:
        read_index(folder, ReadOptions())
    assert raised.value.field == "file"
