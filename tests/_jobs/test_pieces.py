# SPDX-License-Identifier: Apache-2.0
"""Resumable jobs on every engine: missing pieces, errors, killed workers and parents."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from doorstate._files import write_text
from doorstate._jobs import Engine, ProcessEngine, Resources, default_workers, piece_paths, run_pieces
from doorstate.errors import DatasetError, RunError
from tests._jobs.work import gpus, killed, killed_once, square, square_of_positive

SCRIPT = """
import signal
import sys
import time
from pathlib import Path

from doorstate._jobs import piece_paths, run_pieces


def work(piece, path):
    path.write_text("started")
    time.sleep(600)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # background processes of a shell ignore it
    folder = Path(sys.argv[1])
    run_pieces(work, [1, 2], piece_paths(folder, 2, ".txt"), 2)
"""


def test_only_missing_pieces_are_run(tmp_path: Path, engine: Engine) -> None:
    paths = piece_paths(tmp_path, 5, ".txt")
    assert paths[4] == tmp_path / "00004.txt"
    write_text(paths[1], "kept")
    steps: list[tuple[int, int]] = []
    run_pieces(square, [0, 1, 2, 3, 4], paths, engine, lambda *step: steps.append(step))
    assert [path.read_text(encoding="utf-8") for path in paths] == ["0", "kept", "4", "9", "16"]
    assert steps == [(done, 5) for done in range(1, 6)]
    run_pieces(square, [9, 9, 9, 9, 9], paths, engine, lambda *step: steps.append(step))
    assert paths[0].read_text(encoding="utf-8") == "0"
    assert steps[-1] == (5, 5)


def test_errors_are_raised_as_they_are_and_finished_pieces_are_kept(tmp_path: Path, engine: Engine) -> None:
    paths = piece_paths(tmp_path, 4, ".txt")
    with pytest.raises(DatasetError) as caught:
        run_pieces(square_of_positive, [1, 2, 5, -3], paths, engine)
    assert caught.type is DatasetError
    assert (caught.value.message, caught.value.path, caught.value.field) == (
        "-3 is negative",
        paths[3],
        "piece",
    )
    assert (caught.value.expected, caught.value.hint) == ("0 or more", "try 3")
    assert not paths[3].exists()
    kept = [path for path in paths if path.exists()]
    for path in kept:
        path.write_text("kept", encoding="utf-8")
    run_pieces(square_of_positive, [1, 2, 5, 3], paths, engine)
    assert paths[3].read_text(encoding="utf-8") == "9"
    assert all(path.read_text(encoding="utf-8") == "kept" for path in kept)


def test_folders_may_be_relative(tmp_path: Path, engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_pieces(square, [3, 4], piece_paths(Path("pieces"), 2, ".txt"), engine)
    assert (tmp_path / "pieces" / "00001.txt").read_text() == "16"


def test_many_short_pieces_are_all_done(tmp_path: Path, engine: Engine) -> None:
    paths = piece_paths(tmp_path, 400, ".txt")
    steps: list[tuple[int, int]] = []
    run_pieces(square, range(400), paths, engine, lambda *step: steps.append(step))
    assert [int(path.read_text()) for path in paths] == [number**2 for number in range(400)]
    assert steps == sorted(steps)
    assert steps[-1] == (400, 400)


def test_pieces_after_an_error_are_not_started(tmp_path: Path) -> None:
    paths = piece_paths(tmp_path, 3, ".txt")
    with pytest.raises(DatasetError):
        run_pieces(square_of_positive, [1, -2, 3], paths, 1)
    assert [path.exists() for path in paths] == [True, False, False]


@pytest.mark.parametrize("name", ["processes", "ray"])
def test_a_piece_whose_process_is_killed_is_run_again(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    engine = ProcessEngine(2) if name == "processes" else request.getfixturevalue("ray_engine")
    paths = piece_paths(tmp_path, 4, ".txt")
    steps: list[tuple[int, int]] = []
    run_pieces(killed_once, [1, -2, 3, 4], paths, engine, lambda *step: steps.append(step))
    assert [path.read_text() for path in paths] == ["1", "4", "9", "16"]
    assert (tmp_path / "00001.tries").read_text() == "xx"
    assert steps[-1] == (4, 4)


def test_workers_that_are_killed_again_and_again_are_a_run_error(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="killed"):
        run_pieces(killed, [0, 1, 2, 3], piece_paths(tmp_path, 4, ".txt"), 2)


@pytest.mark.parametrize(("share", "seen"), [(0.5, {"4"}), (1, {"4", "7"}), (2, {"4,7"})])
def test_workers_share_gpus_as_asked(
    share: float, seen: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("doorstate._jobs.resources.default_workers", lambda: 2)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "4,7")
    paths = piece_paths(tmp_path, 4, ".txt")
    run_pieces(gpus, range(4), paths, 2, resources=Resources(gpus=share))
    assert {path.read_text() for path in paths} <= {"4", "7", "4,7"}
    assert {path.read_text() for path in paths} == seen


def test_pieces_and_paths_must_have_the_same_length(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="shorter"):
        run_pieces(square, [1, 2], piece_paths(tmp_path, 1, ".txt"), 1)


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_their_parent(stop: signal.Signals, tmp_path: Path) -> None:
    script, folder = tmp_path / "job.py", tmp_path / "pieces"
    folder.mkdir()
    script.write_text(SCRIPT, encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, script, folder], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as parent:
        waited_until = time.monotonic() + 60
        while len(list(folder.iterdir())) < 2:
            assert parent.poll() is None
            assert time.monotonic() < waited_until
            time.sleep(0.01)
        parent.send_signal(stop)
        # Workers inherit the pipe and sleep for minutes, so it closes early only if they end.
        try:
            output, _ = parent.communicate(timeout=30)
        finally:
            parent.kill()
    assert output.count(b"Traceback") <= 1, "workers print none"


def test_there_is_at_least_one_worker() -> None:
    assert default_workers() >= 1
