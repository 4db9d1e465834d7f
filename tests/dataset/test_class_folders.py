# SPDX-License-Identifier: Apache-2.0
"""Class folders in usual spellings."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate.dataset.class_folders import labelled_rows, state_of_folder
from doorstate.errors import CloudReadError, DatasetError
from tests.error_fields import about

SPELLINGS = {
    "open": ["open", "Open", "OPEN", "opened", "open_door", "Open Doors", "02-open", "door_is_open", "acik"],
    "semi_open": [
        "semi",
        "SEMI-OPEN",
        "semi_open",
        "SemiOpen",
        "semiopen_doors",
        "half open",
        "half_closed",
        "partly open",
        "partially-opened",
        "ajar",
        "aralik",
        "yari_acik",
    ],
    "closed": ["closed", "Closed Doors", "01_closed", "close", "shut", "The door is closed", "kapali_1"],
}
NO_STATES = [
    "opening_times",
    "enclosure",
    "data",
    "doors",
    "door",
    "",
    "2019",
    "openai",
    "train",
    "pcd",
    "clothes",
]


@pytest.mark.parametrize(
    ("name", "state"), [(name, state) for state, names in SPELLINGS.items() for name in names]
)
def test_usual_spellings_of_the_states(name: str, state: str) -> None:
    assert state_of_folder(name) == state


@pytest.mark.parametrize("name", NO_STATES)
def test_names_without_a_state(name: str) -> None:
    assert state_of_folder(name) is None


def touch(root: Path, *names: str) -> Path:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).touch()
    return root


def test_the_nearest_folder_with_a_state_decides(tmp_path: Path) -> None:
    root = touch(
        tmp_path / "doors",
        "Train/Closed/1.pcd",
        "Test/Closed/run 2/1.pcd",
        "closed/but_then/Open/a.ply",
        "stray.pcd",
        "opening_times/b.pcd",
        "semi/.hidden.pcd",
        "semi/c.jpg",
    )
    assert labelled_rows(root) == [
        {"sample_id": "closed/but_then/Open/a", "state": "open", "file": "closed/but_then/Open/a.ply"},
        {"sample_id": "Test/Closed/run 2/1", "state": "closed", "file": "Test/Closed/run 2/1.pcd"},
        {"sample_id": "Train/Closed/1", "state": "closed", "file": "Train/Closed/1.pcd"},
    ]


def test_the_root_itself_may_name_the_state(tmp_path: Path) -> None:
    rows = labelled_rows(touch(tmp_path / "open_doors", "a.pcd", "closed/b.pcd"))
    assert [(row["file"], row["state"]) for row in rows] == [("a.pcd", "open"), ("closed/b.pcd", "closed")]


def test_files_of_one_name_and_two_types_are_two_samples(tmp_path: Path) -> None:
    rows = labelled_rows(touch(tmp_path / "d", "open/a.pcd", "open/a.ply", "open/b.pcd", "closed/a.pcd"))
    assert [row["sample_id"] for row in rows] == ["closed/a", "open/a.pcd", "open/a.ply", "open/b"]


def test_folders_without_states_or_clouds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, check=about(tmp_path / "nowhere")):
        labelled_rows(tmp_path / "nowhere")
    with pytest.raises(CloudReadError, check=about(tmp_path / "empty")):
        labelled_rows(touch(tmp_path / "empty", "open/readme.md"))
    with pytest.raises(DatasetError, check=about(tmp_path / "other")):
        labelled_rows(touch(tmp_path / "other", "cats/1.pcd", "dogs/1.pcd"))
