# SPDX-License-Identifier: Apache-2.0
"""`doorstate` commands that other tools run, shown as anybody can type them."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]


def doorstate(arguments: str, fine: Collection[int] = (0,)) -> None:
    """Print and run one command in the repository; an exit code that is not fine ends the tool."""
    print(f"\n$ doorstate {arguments}", flush=True)
    program = Path(sys.executable).with_name("doorstate")
    finished = subprocess.run([program, *shlex.split(arguments)], cwd=REPOSITORY, check=False)
    if finished.returncode not in fine:
        sys.exit(finished.returncode)
