# SPDX-License-Identifier: Apache-2.0
"""Files appear whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate.files import atomic_path, is_vacant, write_text


def test_the_target_appears_when_the_block_ends(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder" / "array.npy"
    with atomic_path(target) as temporary:
        assert temporary.parent == target.parent
        np.save(temporary, np.arange(3))  # adds .npy to any other ending
        assert not target.exists()
    assert list(target.parent.iterdir()) == [target]
    np.testing.assert_array_equal(np.load(target), [0, 1, 2])


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_the_old_file_and_nothing_half_written(
    tmp_path: Path, error: type[BaseException]
) -> None:
    target = tmp_path / "text.txt"
    write_text(target, "old")

    def write_half() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("ne", encoding="utf-8")
            raise error

    with pytest.raises(error):
        write_half()
    assert target.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_writes_nothing_is_an_error_and_keeps_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "text.txt"
    write_text(target, "old")
    with pytest.raises(FileNotFoundError), atomic_path(target):
        pass
    assert target.read_text(encoding="utf-8") == "old"


def test_text_is_utf_8_whatever_the_locale(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "yarı açık kapı")
    assert (tmp_path / "a.txt").read_bytes() == "yarı açık kapı".encode()


def test_a_folder_is_vacant_until_something_whole_is_in_it(tmp_path: Path) -> None:
    assert is_vacant(tmp_path / "new")
    (tmp_path / ".123.tmp.manifest.csv").touch()
    assert is_vacant(tmp_path)
    (tmp_path / "notes.txt").touch()
    assert not is_vacant(tmp_path)
    assert not is_vacant(tmp_path / "notes.txt")
