# SPDX-License-Identifier: Apache-2.0
"""Pairs of processes that write one file: `python -m tests.attack_files --pairs 100` counts torn files.

Both processes of a pair write the same target, in threads too, and a third reads it all the time. Each gets its own
process number space where the kernel allows it (`unshare`), so that both believe to be process 1, as in containers.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

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


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.attack_files", description=__doc__)
    parser.add_argument("--pairs", type=int, default=100)
    pairs = parser.parse_args().pairs
    isolate, started = isolation(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        torn = sum(count_torn(Path(folder) / "target.txt", isolate) for _ in range(pairs))
    where = "as process 1 each" if isolate else "with different process numbers"
    print(f"{pairs} pairs {where}: {torn} torn files or failures, {time.monotonic() - started:.0f} s")
    sys.exit(torn != 0)


if __name__ == "__main__":
    main()
