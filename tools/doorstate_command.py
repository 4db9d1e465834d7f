# SPDX-License-Identifier: Apache-2.0
"""`doorstate` commands that other tools run, shown as anybody can type them."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]


def doorstate(arguments: str) -> None:
    """Print and run one command in the repository; its error ends the tool."""
    print(f"\n$ doorstate {arguments}", flush=True)
    program = Path(sys.executable).with_name("doorstate")
    finished = subprocess.run([program, *shlex.split(arguments)], cwd=REPOSITORY, check=False)
    if finished.returncode:
        sys.exit(finished.returncode)
