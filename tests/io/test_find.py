# SPDX-License-Identifier: Apache-2.0
"""Cloud files found in folders: order, skipped files, errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.errors import CloudReadError
from doorstate.io.find import find_clouds


def touch(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return path


def test_files_are_kept_and_folders_are_searched(tmp_path: Path) -> None:
    for name in ("10.pcd", "2.PCD", "b/1.ply", "b/a_rgb.png", "b/A_RGB.PNG", "b/a.png", "b/notes.md"):
        touch(tmp_path / "scans" / name)
    for name in (".hidden.pcd", ".cache/1.pcd"):
        touch(tmp_path / "scans" / name)
    (tmp_path / "scans" / "folder.pcd").mkdir()
    file = touch(tmp_path / "odd.suffix")
    clouds = find_clouds([file, tmp_path / "scans", file])
    assert [path.relative_to(tmp_path).as_posix() for path in clouds] == [
        "odd.suffix", "scans/2.PCD", "scans/10.pcd", "scans/b/1.ply", "scans/b/a.png", "odd.suffix",
    ]  # fmt: skip


def test_a_folder_below_a_hidden_one_is_not_hidden(tmp_path: Path) -> None:
    path = touch(tmp_path / ".data/scan.pcd")
    assert find_clouds([path.parent]) == [path]


def test_missing_paths_and_folders_without_clouds_are_errors(tmp_path: Path) -> None:
    touch(tmp_path / "pictures/a_rgb.png")
    touch(tmp_path / "bag/a.mcap")
    for name in ("absent", "pictures", "bag"):
        with pytest.raises(CloudReadError) as caught:
            find_clouds([tmp_path / name])
        assert caught.value.path == tmp_path / name
        assert (caught.value.hint is not None) == (name == "bag")
    assert find_clouds([]) == []


def test_tables_about_clouds_and_prepared_data_sets_are_not_clouds(tmp_path: Path) -> None:
    for name in ("a.pcd", "index.csv", "manifest.csv", "predictions.csv", "rejected.csv", "points.csv"):
        touch(tmp_path / name)
    assert [path.name for path in find_clouds([tmp_path])] == ["a.pcd", "points.csv"]
    assert find_clouds([tmp_path / "index.csv"]) == [tmp_path / "index.csv"], "a file that was named"
    touch(tmp_path / "dataset.json")
    with pytest.raises(CloudReadError) as caught:
        find_clouds([tmp_path])
    assert caught.value.path == tmp_path


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=6, unique=True), st.randoms())
@settings(max_examples=20)
def test_numbers_in_names_are_sorted_by_value(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[int], random: Any
) -> None:
    folder = tmp_path_factory.mktemp("order")
    random.shuffle(numbers)
    for number in numbers:
        touch(folder / f"frame{number}.pcd")
    assert find_clouds([folder]) == [folder / f"frame{number}.pcd" for number in sorted(numbers)]
