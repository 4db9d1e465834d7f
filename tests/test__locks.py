# SPDX-License-Identifier: Apache-2.0
"""Folders have one owner, whose end ends the lock."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock

from doorstate import _locks
from doorstate._files import is_vacant
from doorstate._locks import owned_folder
from doorstate.errors import DoorstateError, FolderInUseError, OutputError

HOLD = """
import sys, time
from pathlib import Path
from typing import Any
from doorstate._locks import owned_folder
with owned_folder(Path(sys.argv[1]), sys.argv[2]):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture(autouse=True)
def _short_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_locks, "_WAIT_S", 0.2)


def hold(folder: Path, part: str = "") -> subprocess.Popen[str]:
    """Start a process that owns a folder until it is killed."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, folder, part], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_process_is_told_the_first_until_that_is_killed(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    process = hold(folder)
    with pytest.raises(FolderInUseError) as refused, owned_folder(folder):
        pass
    assert refused.value.path == folder
    assert f" {process.pid} " in str(refused.value)
    assert socket.gethostname() in str(refused.value)
    assert is_vacant(folder)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    with owned_folder(folder):
        assert json.loads((folder / ".doorstate.owner").read_text())["process"] == os.getpid()
    assert list(folder.iterdir()) == []


def test_parts_are_owned_apart_but_not_beside_the_whole(tmp_path: Path) -> None:
    process = hold(tmp_path, "1-of-2")
    with owned_folder(tmp_path, "2-of-2"):
        pass
    for part in ("", "1-of-2"):
        with pytest.raises(FolderInUseError, match=f" {process.pid} "), owned_folder(tmp_path, part):
            pass
    process.kill()
    process.communicate()
    with owned_folder(tmp_path):
        assert [path.name for path in tmp_path.glob("*-of-2*")] == []


def test_threads_of_one_process_are_strangers_and_blocks_nest(tmp_path: Path) -> None:
    refused: list[DoorstateError] = []

    def enter() -> None:
        try:
            with owned_folder(tmp_path):
                pass
        except FolderInUseError as error:
            refused.append(error)

    with owned_folder(tmp_path):
        with owned_folder(tmp_path / "." / ""):
            pass
        thread = threading.Thread(target=enter)
        thread.start()
        thread.join()
    assert len(refused) == 1
    enter()
    assert len(refused) == 1


def test_a_new_folder_without_files_is_removed(tmp_path: Path) -> None:
    with pytest.raises(KeyError), owned_folder(tmp_path / "new"):
        raise KeyError
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old").mkdir()
    with owned_folder(tmp_path / "old"):
        pass
    assert (tmp_path / "old").is_dir()


def test_an_interrupted_lock_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    acquire = FileLock.acquire

    def interrupted(lock: FileLock, **options: Any) -> None:
        monkeypatch.setattr(FileLock, "acquire", acquire)
        Path(lock.lock_file).touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(FileLock, "acquire", interrupted)
    with pytest.raises(KeyboardInterrupt), owned_folder(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []
    with owned_folder(tmp_path):
        assert len(list(tmp_path.iterdir())) == 2


def test_temporary_files_of_killed_processes_are_removed(tmp_path: Path) -> None:
    old, new, other = tmp_path / f".{'0' * 16}.tmp.a", tmp_path / f".{'1' * 16}.tmp.a", tmp_path / "b.tmp.a"
    for path in (old, new, other):
        path.touch()
    for path in (old, other):
        os.utime(path, (0, 0))
    with owned_folder(tmp_path):
        pass
    assert sorted(tmp_path.iterdir()) == [new, other]


def test_what_cannot_be_written_has_no_owner(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with owned_folder(tmp_path / "file"):
        pass
    with pytest.raises(OutputError), owned_folder(tmp_path / "file" / "folder"):
        pass
