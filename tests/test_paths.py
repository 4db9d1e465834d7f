# SPDX-License-Identifier: Apache-2.0
"""Names in tables that lead out of their folder, and names that would be obeyed."""

from __future__ import annotations

from pathlib import Path

import pytest

from doorstate._paths import csv_name, resolve_inside
from doorstate.errors import DatasetError


@pytest.mark.parametrize(
    "name", ["a.png", "sub/a.png", "./a.png", "sub/../a.png", "", "..a/b", "not there.png"]
)
def test_names_inside(name: str, tmp_path: Path) -> None:
    assert resolve_inside(tmp_path, name) == tmp_path / name


@pytest.mark.parametrize(
    "name", ["../a.png", "sub/../../a.png", "/etc/passwd", "link/a.png", "loop", "nul\0l"]
)
def test_names_outside_are_refused(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    (folder / "sub").mkdir(parents=True)
    (folder / "link").symlink_to(tmp_path)
    (folder / "loop").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(DatasetError) as caught:
        resolve_inside(folder, name)
    assert caught.value.path == folder
    assert str(caught.value).isprintable()


def test_links_to_files_inside_are_followed(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    (tmp_path / "b.png").symlink_to("a.png")
    assert resolve_inside(tmp_path, "b.png").is_file()


@pytest.mark.parametrize("name", ["=SUM(A1).npy", "+1.npy", "-x.npy", "@a.npy"])
def test_file_names_are_no_formulas(name: str) -> None:
    assert csv_name(name) == f"./{name}"
    assert csv_name("a/" + name) == "a/" + name


def test_file_names_in_csv_are_not_obeyed_by_terminals() -> None:
    assert csv_name("\x1b[31ma.npy") == r"\x1b[31ma.npy"
