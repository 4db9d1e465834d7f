# SPDX-License-Identifier: Apache-2.0
"""Two processes on one folder or file, with equal process numbers: no file is torn or mixed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from threading import Thread

from doorstate._files import is_scratch, write_text
from tests.attack.processes import Command, Process, run
from tests.attack.samples import POINTS, contents, prepared, simulated
from tests.attack.tries import Try, Violation, attempt

_LETTERS = 100_000
_PAIRS = {"simulate": 40, "prepare": 40, "train": 10, "compare": 10}  # of a hundred


def attack_folders(folder: Path, rounds: int) -> Iterator[Try]:
    """Start pairs of commands on one output folder, each as process 1 of its container."""
    data = prepared(folder / "data", scenes=12)
    commands: dict[str, Sequence[object]] = {
        "simulate": ["--preset", "varied", "--scenes", 1, "--workers", 1],
        "prepare": [folder / "data-raw", "--points", POINTS, "--workers", 1],
        "train": ["--network", "pointnet", "--data", data, "--points", POINTS, "--epochs", 1],
        "compare": ["--network", "pointnet", "--data", data, "--points", POINTS, "--epochs", 1, "--folds", 1],
    }
    for name, arguments in commands.items():
        alone = folder / name
        assert run(folder, name, *arguments, "--out", alone).code == 0
        expected = _results(alone)
        for number in range(max(1, rounds * _PAIRS[name] // 100)):
            out = folder / f"{name}{number}" / name
            out.parent.mkdir()
            pair = [Command(folder, [name, *arguments, "--out", out], first=True) for _ in range(2)]
            codes = sorted(one.wait().code for one in pair)

            def judge() -> str:
                assert _results(out) == expected, "other files than alone"  # noqa: B023
                assert codes in ([0, 0], [0, 1]), f"exit codes {codes}"  # noqa: B023
                return "both end with the files of one" if codes[1] == 0 else "the second is told the first"  # noqa: B023

            yield attempt(f"two `{name}` in one folder", judge, Violation.TORN)


def attack_shards(folder: Path, rounds: int) -> Iterator[Try]:
    """Write parts of one data set at once, each as process 1 of its container."""
    raw = simulated(folder / "raw", scenes=4)
    arguments = ["prepare", raw, "--points", POINTS, "--workers", 1]
    assert run(folder, *arguments, "--out", folder / "alone").code == 0
    for number in range(max(1, rounds // 10)):
        out = folder / f"parts{number}"
        line = [*arguments, "--out", out]
        pair = [Command(folder, [*line, "--shard", f"{part}/2"], first=True) for part in (1, 2)]
        codes = [one.wait().code for one in pair] + [run(folder, *line).code]

        def judge() -> str:
            assert codes == [0, 0, 0], f"exit codes {codes}"  # noqa: B023
            assert _results(out) == _results(folder / "alone"), "other files than alone"  # noqa: B023
            return "same files as alone"

        yield attempt("two shards of `prepare` at once", judge, Violation.TORN)


def attack_files(folder: Path, rounds: int) -> Iterator[Try]:
    """Write one file from two processes of two threads each, both process 1 of a container, while it is read."""
    target = folder / "shared" / "target.txt"
    target.parent.mkdir()
    for _ in range(rounds):
        pair = [Process(folder, partial(_write, target, letters), first=True) for letters in ("ab", "cd")]
        torn = 0
        while any(one.is_running() for one in pair):
            if target.exists():
                text = target.read_text(encoding="utf-8")
                torn += len(text) != _LETTERS or len(set(text)) != 1
        codes = [one.wait().code for one in pair]

        def judge() -> str:
            assert not torn, f"torn {torn} times"  # noqa: B023
            assert codes == [0, 0], f"exit codes {codes}"  # noqa: B023
            assert list(target.parent.iterdir()) == [target], "temporary files are left"
            return "whole"

        yield attempt("two processes of two threads write one file", judge, Violation.TORN)


def _write(target: Path, letters: str) -> None:
    def work(letter: str) -> None:
        for _ in range(30):
            write_text(target, letter * _LETTERS, durable=False)

    threads = [Thread(target=work, args=letter) for letter in letters]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _results(folder: Path) -> dict[str, bytes]:
    """Return the contents of result files: those without times and names of folders."""
    files = contents(folder)
    assert not [name for name in files if is_scratch(Path(name))], "temporary files are left"
    names = ("manifest.csv", ".npy", ".safetensors", "predictions.csv", "splits.csv", ".pcd")
    return {name: content for name, content in files.items() if name.endswith(names)}
