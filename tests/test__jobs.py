# SPDX-License-Identifier: Apache-2.0
"""Resumable jobs: missing pieces, errors, killed workers and parents, shards."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from doorstate._files import write_text
from doorstate._jobs import Shard, default_workers, piece_paths, run_pieces
from doorstate.errors import ConfigError, RunError

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


def square(piece: int, path: Path) -> None:
    write_text(path, str(piece**2))


def square_of_positive(piece: int, path: Path) -> None:
    if piece < 0:
        raise ValueError(f"{piece} is negative")
    square(piece, path)


def killed(piece: int, path: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize("workers", [1, 2])
def test_only_missing_pieces_are_run(tmp_path: Path, workers: int) -> None:
    paths = piece_paths(tmp_path, 5, ".txt")
    assert paths[4] == tmp_path / "00004.txt"
    write_text(paths[1], "kept")
    steps: list[tuple[int, int]] = []
    run_pieces(square, [0, 1, 2, 3, 4], paths, workers, lambda *step: steps.append(step))
    assert [path.read_text(encoding="utf-8") for path in paths] == ["0", "kept", "4", "9", "16"]
    assert steps == [(done, 5) for done in range(1, 6)]
    run_pieces(square, [9, 9, 9, 9, 9], paths, workers, lambda *step: steps.append(step))
    assert paths[0].read_text(encoding="utf-8") == "0"
    assert steps[-1] == (5, 5)


@pytest.mark.parametrize("workers", [1, 2])
def test_errors_are_raised_and_finished_pieces_are_kept(tmp_path: Path, workers: int) -> None:
    paths = piece_paths(tmp_path, 4, ".txt")
    with pytest.raises(ValueError, match=r"^-3 is negative$"):
        run_pieces(square_of_positive, [1, 2, 5, -3], paths, workers)
    assert [path.exists() for path in paths] == [True, True, True, False]
    run_pieces(square_of_positive, [1, 2, 5, 3], paths, workers)
    assert paths[3].read_text(encoding="utf-8") == "9"


def test_pieces_after_an_error_are_not_started(tmp_path: Path) -> None:
    paths = piece_paths(tmp_path, 3, ".txt")
    with pytest.raises(ValueError, match="negative"):
        run_pieces(square_of_positive, [1, -2, 3], paths, 1)
    assert [path.exists() for path in paths] == [True, False, False]


def test_a_killed_worker_is_a_run_error(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="killed"):
        run_pieces(killed, [0, 1], piece_paths(tmp_path, 2, ".txt"), 2)


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


def test_shards_cover_all_pieces() -> None:
    pieces = list(range(11))
    for count in (1, 3, 8, 11, 20):
        shares = [Shard.parse(f"{number}/{count}").select(pieces) for number in range(1, count + 1)]
        assert sorted(piece for share in shares for piece in share) == pieces
        assert max(map(len, shares)) - min(map(len, shares)) <= 1


@pytest.mark.parametrize("text", ["", "2", "0/3", "4/3", "1/0", "-1/2", "1/2/3", "a/b", "1/2 ", "1.0/2"])
def test_other_texts_are_no_shards(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Shard.parse(text)
    assert caught.value.field == "shard"
