# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files, and tables that are read as they were written."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from doorstate._files import (
    atomic_path,
    check_writable,
    is_vacant,
    read_csv,
    write_compressed_text,
    write_csv,
    write_text,
)
from doorstate.errors import DatasetError, OutputError


def test_the_target_appears_when_the_block_ends(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder" / "array.npy"
    with atomic_path(target) as temporary:
        assert temporary.parent == target.parent
        np.save(temporary, np.arange(3))  # adds .npy to any other ending
        assert not target.exists()
    assert list(target.parent.iterdir()) == [target]
    np.testing.assert_array_equal(np.load(target), [0, 1, 2])


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_keeps_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
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


def test_a_file_is_on_the_disk_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, steps = tmp_path / "a.txt", list[tuple[Path, bool]]()
    monkeypatch.setattr(
        "doorstate._files._sync", lambda path, flags=os.O_RDWR: steps.append((path, target.exists()))
    )
    write_text(target, "text", durable=False)
    assert steps == []
    target.unlink()
    write_text(target, "text")
    (temporary, before), (folder, after) = steps
    assert (temporary.parent, before, folder, after) == (tmp_path, False, tmp_path, True)


def test_real_files_and_folders_can_be_synced(tmp_path: Path) -> None:
    code = "import sys, pathlib, doorstate._files as files; files.write_text(pathlib.Path(sys.argv[1]), 'b')"
    subprocess.run([sys.executable, "-c", code, tmp_path / "a"], check=True)
    assert (tmp_path / "a").read_text() == "b"


def test_threads_never_show_a_torn_file(tmp_path: Path) -> None:
    target, texts, torn = tmp_path / "a.txt", ["a" * 300_000, "b" * 200_000], list[int]()
    write_text(target, texts[0])
    stop = threading.Event()

    def read() -> None:
        while not stop.is_set():
            if (text := target.read_text(encoding="utf-8")) not in texts:
                torn.append(len(text))

    def write(text: str) -> None:
        for _ in range(100):
            write_text(target, text)

    reader = threading.Thread(target=read)
    writers = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in (reader, *writers):
        thread.start()
    for thread in writers:
        thread.join()
    stop.set()
    reader.join()
    assert torn == []
    assert list(tmp_path.iterdir()) == [target]


def test_unwritable_targets_are_output_errors(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for target in (tmp_path / "file" / "page.html", tmp_path):
        for write in (check_writable, lambda path: write_text(path, "text")):
            with pytest.raises(OutputError) as caught:
                write(target)
            assert caught.value.path == target


def test_check_writable_creates_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "new" / "folder" / "page.html")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_an_output_error_and_errors_of_other_files_are_not(tmp_path: Path) -> None:
    refused = pytest.raises(OutputError, match="No space left on device")
    with refused, atomic_path(tmp_path / "a.txt"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(PermissionError), atomic_path(tmp_path / "a.txt"):
        raise PermissionError(errno.EACCES, "denied", "another.txt")


def test_text_is_utf_8_in_every_locale(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "yarı açık kapı")
    assert (tmp_path / "a.txt").read_bytes() == "yarı açık kapı".encode()


def test_broken_characters_of_file_names_are_escaped(tmp_path: Path) -> None:
    for name in ("a.csv", "a.csv.gz"):
        write_csv(tmp_path / name, [{"file": "a\udcff"}])
        assert read_csv(tmp_path / name) == [{"file": r"a\udcff"}]


def test_folders_with_only_temporary_files_are_vacant(tmp_path: Path) -> None:
    assert is_vacant(tmp_path / "new")
    for name in (
        ".123.tmp.manifest.csv",
        ".00ff00ff00ff00ff.tmp.a",
        ".doorstate.lock",
        ".doorstate-2-of-8.owner",
    ):
        (tmp_path / name).touch()
    assert is_vacant(tmp_path)
    (tmp_path / "my.tmp.txt").touch()
    assert not is_vacant(tmp_path)
    (tmp_path / "my.tmp.txt").unlink()
    (tmp_path / "notes.txt").touch()
    assert not is_vacant(tmp_path)
    assert not is_vacant(tmp_path / "notes.txt")


def test_rows_with_different_columns_share_one_header(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", [{"a": "1"}, {"b": 'two, "2"', "a": "line\nbreak"}])
    assert read_csv(tmp_path / "a.csv") == [{"a": "1", "b": ""}, {"a": "line\nbreak", "b": 'two, "2"'}]


@pytest.mark.parametrize(
    "content",
    [None, b"a,b\n1\n", b"a,b\n1,2,3\n", b"a,b\n\xff\xfe,2\n", b'a,b\n"1"2,3\n'],
    ids=["missing", "short", "long", "not UTF-8", "stray quote"],
)
def test_other_files_are_dataset_errors(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "manifest.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DatasetError) as caught:
        read_csv(path)
    assert caught.value.path == path


def test_a_table_saved_by_a_spreadsheet_has_the_same_columns(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("file,state\na.pcd,open\n", encoding="utf-8-sig")
    assert read_csv(tmp_path / "a.csv") == [{"file": "a.pcd", "state": "open"}]


def test_tables_and_lines_beyond_the_limits_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_text(tmp_path / "a.csv", "a,b\n1,22\n")
    write_compressed_text(tmp_path / "a.csv.gz", "a,b\n" + 30 * "1,22\n")
    assert read_csv(tmp_path / "a.csv") == [{"a": "1", "b": "22"}]
    assert len(read_csv(tmp_path / "a.csv.gz")) == 30
    monkeypatch.setattr("doorstate._files._MAX_LINE", 4)
    with pytest.raises(DatasetError):
        read_csv(tmp_path / "a.csv")
    monkeypatch.setattr("doorstate._files._MAX_LINE", 100)
    monkeypatch.setattr("doorstate._files.MAX_TABLE_BYTES", 120)
    with pytest.raises(DatasetError):
        read_csv(tmp_path / "a.csv.gz")


def test_equal_texts_of_neighbouring_lines_are_one_object(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", "a,b\nscene,1\nscene,2\nother,2\n")
    first, second, third = read_csv(tmp_path / "a.csv")
    assert first["a"] is second["a"]
    assert [row["a"] for row in (first, second, third)] == ["scene", "scene", "other"]
