# SPDX-License-Identifier: Apache-2.0
"""Opening of files given by a user: regular files of limited size, links to them, and everything else refused."""

from __future__ import annotations

import os
import resource
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from doorstate._input import check_input, open_input, read_input, read_input_text
from doorstate.errors import CameraError, CloudReadError
from tests.error_fields import about


def _refusal(path: Path, max_bytes: int | None = 8) -> CameraError:
    """Return the error of a path, the same from every function, of the class asked for."""
    errors = []
    for call in (check_input, lambda *arguments: open_input(*arguments).__enter__()):
        with pytest.raises(CameraError, check=about(path)) as caught:
            call(path, max_bytes, CameraError)  # type: ignore[operator]
        errors.append(caught.value)
    assert str(errors[0]) == str(errors[1])
    return errors[0]


def test_files_and_links_to_files_are_read(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.write_bytes(b"\xef\xbb\xbfabc")
    link.symlink_to(file)
    for path in (file, link, str(link)):
        check_input(path, 6)
        assert read_input(path, 6) == b"\xef\xbb\xbfabc"
        assert read_input_text(path, 6) == "abc"


def test_text_in_another_encoding_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"ab\xff")
    with pytest.raises(CameraError, check=about(tmp_path / "a")):
        read_input_text(tmp_path / "a", 8, CameraError)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))


@pytest.mark.parametrize(
    "make",
    [
        lambda path: None,
        lambda path: path.mkdir(),
        lambda path: os.mkfifo(path),
        lambda path: path.symlink_to("/dev/zero"),
        lambda path: path.symlink_to(path),
        _socket,
    ],
    ids=["missing", "folder", "pipe", "device", "ring", "socket"],
)
def test_everything_else_is_refused_at_once(
    make: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    make(Path("a"))
    _refusal(Path("a"), None)


def test_names_with_a_null_byte_do_not_exist() -> None:
    with pytest.raises(CloudReadError):
        read_input("a\0b", 8)


def test_large_files_are_refused_before_they_are_read(tmp_path: Path) -> None:
    with (tmp_path / "sparse").open("wb") as stream:
        stream.truncate(200 << 30)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    error = _refusal(tmp_path / "sparse")
    assert error.expected == "at most 8"
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1 << 14  # KiB


def test_a_file_that_is_larger_than_its_declared_size_is_refused() -> None:
    if not Path("/proc/self/maps").exists():
        pytest.skip("no /proc")
    with pytest.raises(CloudReadError):
        read_input("/proc/self/maps", 8)  # its status says 0 bytes
