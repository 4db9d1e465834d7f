# SPDX-License-Identifier: Apache-2.0
"""Labels in an index: written whole, read again before each change, and nothing else is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate import _files
from doorstate._files import read_csv, write_csv
from doorstate.dataset.frame_labels import DoorLabel, LabelIndex
from doorstate.dataset.labelled import labelled_frames
from doorstate.doorways.doorway import Doorway
from doorstate.errors import DatasetError
from doorstate.types import NO_DOOR

LEFT = Doorway(2.0, 1.0, 95.5, 0.85, -1.2)
RIGHT = Doorway(2.5, -1.0, 88.0, 0.9, -1.2)


def test_labels_are_read_back_and_by_evaluation(tmp_path: Path) -> None:
    for name in ("a.npy", "b.npy"):
        np.save(tmp_path / name, np.ones((200, 3), np.float32))
    index = LabelIndex(tmp_path)
    assert index.labels() == {}
    two = (DoorLabel("closed", "kitchen", LEFT), DoorLabel("open", "", RIGHT))
    index.replace("b.npy", two, "b")
    index.replace("a.npy", (DoorLabel(NO_DOOR),), "a", {"axes": "ros"})
    assert index.labels() == {"b.npy": two, "a.npy": (DoorLabel(NO_DOOR),)}
    assert index.column("moment") == {"b.npy": "b", "a.npy": "a"}
    frames = labelled_frames(tmp_path)
    assert [(frame.name, frame.label, frame.doorway) for frame in frames] == [
        ("b.npy", "closed", LEFT),
        ("b.npy#2", "open", RIGHT),
        ("a.npy", NO_DOOR, None),
    ]
    assert [frame.columns["door"] for frame in frames] == ["kitchen", "", ""]


def test_columns_and_lines_of_others_stay(tmp_path: Path) -> None:
    path = tmp_path / "index.csv"
    path.write_text(
        'file,state,door,sensor,note,fx\n./a.pcd,,,D435,"dark, glossy",501\nb.pcd,ambiguous,old,,keep me,\n',
        encoding="utf-8",
    )
    index = LabelIndex(tmp_path)
    assert index.labels() == {"b.pcd": (DoorLabel("ambiguous", "old"),)}
    before = index.lines("a.pcd")
    index.replace("a.pcd", (DoorLabel("open", "new", LEFT),), "a", {"fx": "1", "fy": "2"})
    row = read_csv(path)[0]
    assert (row["file"], row["state"], row["note"], row["fx"], row["fy"]) == (
        "./a.pcd",
        "open",
        "dark, glossy",
        "501",
        "2",
    )
    # Another program adds a line meanwhile.
    write_csv(path, [*read_csv(path), {"file": "c.pcd", "state": "closed"}])
    index.restore("a.pcd", before)
    rows = read_csv(path)
    assert [(row["file"], row["state"]) for row in rows] == [
        ("./a.pcd", ""),
        ("b.pcd", "ambiguous"),
        ("c.pcd", "closed"),
    ]
    assert [row["note"] for row in rows] == ["dark, glossy", "keep me", ""]


def test_an_index_without_lines_is_removed(tmp_path: Path) -> None:
    index = LabelIndex(tmp_path)
    index.replace("a.pcd", (DoorLabel("open"),))
    index.restore("a.pcd", [])
    assert list(tmp_path.iterdir()) == []


def test_a_killed_write_leaves_the_labels_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    index = LabelIndex(tmp_path)
    index.replace("a.pcd", (DoorLabel("open"),))

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(_files, "_sync", killed)
    with pytest.raises(KeyboardInterrupt):
        index.replace("b.pcd", (DoorLabel("closed"),))
    assert index.labels() == {"a.pcd": (DoorLabel("open"),)}
    assert [path.name for path in tmp_path.iterdir()] == ["index.csv"]


def test_labels_of_class_folders_are_not_hidden(tmp_path: Path) -> None:
    files = ["Semi-Open/a.pcd", "no door/b.pcd", "new/c.pcd"]
    index = LabelIndex(tmp_path, files)
    assert index.labels() == {
        "Semi-Open/a.pcd": (DoorLabel("semi_open"),),
        "no door/b.pcd": (DoorLabel(NO_DOOR),),
    }
    index.replace("new/c.pcd", (DoorLabel("open"),))
    assert [row["state"] for row in read_csv(index.path)] == ["semi_open", NO_DOOR, "open"]


def test_names_that_a_spreadsheet_would_run_are_written_as_paths(tmp_path: Path) -> None:
    index = LabelIndex(tmp_path)
    index.replace("=1.pcd", (DoorLabel("open"),))
    assert read_csv(index.path)[0]["file"] == "./=1.pcd"
    assert set(index.labels()) == {"=1.pcd"}


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("name,state\na.pcd,open\n", "file"),
        ("file,note\na.pcd,open\n", "state"),
        ("file,state,door_x_m\na.pcd,open,1\n", "door_y_m"),
        (
            "file,state,door_x_m,door_y_m,door_yaw_deg,door_width_m,door_floor_z_m\na,open,1,x,0,1,0\n",
            "door_y_m",
        ),
        (
            "file,state,door_x_m,door_y_m,door_yaw_deg,door_width_m,door_floor_z_m\na,open,1,1,0,0,0\n",
            "door_width_m",
        ),
    ],
)
def test_damaged_index_is_refused(text: str, field: str, tmp_path: Path) -> None:
    (tmp_path / "index.csv").write_text(text, encoding="utf-8")
    with pytest.raises(DatasetError) as raised:
        LabelIndex(tmp_path).labels()
    assert raised.value.field == field
