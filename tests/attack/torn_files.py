# SPDX-License-Identifier: Apache-2.0
"""Pairs of processes that write one file.

Both processes of a pair write the same target, in threads too, and a third reads it all the time. Each gets its own
process number space where the kernel allows it (`unshare`), so that both believe to be process 1, as in containers.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.attack.tries import Try, Violation

_WRITE = """
import sys, threading
from pathlib import Path
from doorstate._files import write_text
def work(text):
    for _ in range(30):
        write_text(Path(sys.argv[1]), text * 100_000, durable=False)
threads = [threading.Thread(target=work, args=(letter,)) for letter in sys.argv[2]]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
"""


def attack_files(folder: Path, rounds: int) -> Iterator[Try]:
    """Write one file from two processes of two threads each, while it is read."""
    isolate = isolation()
    for _ in range(rounds):
        violation = Violation.TORN if count_torn(folder / "target.txt", isolate) else None
        yield Try("two processes write one file", "torn" if violation else "whole", violation)


def count_torn(target: Path, isolate: list[str]) -> int:
    """Run one pair on a target, and return how often it was seen torn, plus the processes that failed."""
    command = [*isolate, sys.executable, "-c", _WRITE, str(target)]
    pair = [subprocess.Popen([*command, letters]) for letters in ("ab", "cd")]
    torn = 0
    while any(process.poll() is None for process in pair):
        if target.exists():
            text = target.read_text(encoding="utf-8")
            torn += len(text) != 100_000 or len(set(text)) != 1
    left = [path for path in target.parent.iterdir() if path != target]
    return torn + len(left) + sum(process.returncode != 0 for process in pair)


def isolation() -> list[str]:
    """Return the command that starts a program as process 1, or nothing where that is not allowed."""
    command = ["unshare", "--user", "--map-root-user", "--pid", "--fork"]
    allowed = (
        shutil.which("unshare") and subprocess.run([*command, "true"], capture_output=True).returncode == 0
    )
    return command if allowed else []
