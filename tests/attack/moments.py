# SPDX-License-Identifier: Apache-2.0
"""SIGINT and SIGTERM at many moments of short commands, from the first line of the program to its end."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from doorstate._files import is_scratch
from tests.attack.processes import wait_for_handlers
from tests.attack.samples import first_cloud, simulated
from tests.attack.tries import Try, Violation

_STARTS = ([sys.executable, "-m", "doorstate"], [str(Path(sys.executable).with_name("doorstate"))])
_KINDS = (signal.SIGINT, signal.SIGTERM)
_LONGEST_S = 60.0
_UNWANTED = ("Traceback", "Exception ignored", "leaked")


def attack_moments(folder: Path, rounds: int) -> Iterator[Try]:
    """End commands at moments from start to end, 10 ms apart in full; half of the signals go to workers too."""
    cloud = first_cloud(simulated(folder / "raw", scenes=1))
    commands: list[list[object]] = [
        ["predict", *[cloud] * 5, "--out", "out.csv"],
        ["simulate", "--poses", 12, "--workers", 2, "--out", "out"],
        ["simulate", "--poses", 2, "--workers", 1, "--out", "out"],
        ["info"],
        ["--help"],
    ]
    for arguments in commands if rounds > 1 else commands[:2]:
        seconds = min(_seconds([*start, *map(str, arguments)], folder / "alone") for start in _STARTS)
        count = min(rounds, round(100 * seconds)) if rounds > 1 else 2
        for number in range(count):
            for kind in _KINDS if rounds > 1 else _KINDS[number : number + 1]:
                run = _Run(folder / "run", [*_STARTS[number % 2], *map(str, arguments)])
                yield _try_at(
                    run,
                    str(arguments[0]),
                    kind,
                    seconds * (number + 0.5) / count,
                    number % 4 > 1 or rounds == 1,
                )


class _Run:
    """Running program, in a folder and a group of processes of its own."""

    def __init__(self, folder: Path, line: Sequence[str]) -> None:
        folder.mkdir()
        self._folder = folder
        self._process = subprocess.Popen(
            line,
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            # The child of a background job would ignore SIGINT.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )

    def send(self, number: signal.Signals, delay_s: float, to_workers: bool) -> None:
        """Send a signal some time after the first line of the program; before it, the interpreter handles signals."""
        wait_for_handlers(self._process.pid)
        time.sleep(delay_s)
        with suppress(ProcessLookupError):
            (os.killpg if to_workers else os.kill)(self._process.pid, number)

    def end(self) -> tuple[int, str, list[Path]]:
        """Return exit code, standard error and temporary files that are left; the folder is removed."""
        try:
            _, errors = self._process.communicate(timeout=_LONGEST_S)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            _, errors = self._process.communicate()
        left = [path for path in self._folder.rglob("*") if is_scratch(path)]
        shutil.rmtree(self._folder)
        return self._process.returncode, errors, left


def _seconds(line: Sequence[str], folder: Path) -> float:
    started = time.monotonic()
    assert _Run(folder, line).end()[0] == 0
    return time.monotonic() - started


def _try_at(run: _Run, name: str, number: signal.Signals, delay_s: float, to_workers: bool) -> Try:
    run.send(number, delay_s, to_workers)
    code, errors, left = run.end()
    kind = f"{number.name} at any moment of `{name}`"
    if left:
        return Try(kind, f"left: {', '.join(path.name for path in left)}", Violation.TORN)
    if code not in (0, -number) or any(text in errors for text in _UNWANTED):
        return Try(kind, f"exit code {code}: {errors.strip()[-300:]}", Violation.UNCAUGHT)
    return Try(kind, "ended by the signal" if code else "done")
