# SPDX-License-Identifier: Apache-2.0
"""Commands of `doorstate` as subprocesses in the repository, printed as a user can type them."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

from doorstate.dataset.store import is_prepared

from .paths import REPOSITORY


def run_doorstate(arguments: str, prepared: Path | None = None) -> None:
    """Print and run one command; exit with its code if it fails.

    Args:
        arguments: command and options, without `doorstate`.
        prepared: data set that the command makes. If it exists afterwards, exit code 1 means that some clouds were
            left out, which is no failure.
    """
    print(f"\n$ doorstate {arguments}", flush=True)
    program = Path(sys.executable).with_name("doorstate")
    finished = subprocess.run([program, *shlex.split(arguments)], cwd=REPOSITORY, check=False)
    is_partial = finished.returncode == 1 and prepared is not None and is_prepared(prepared)
    if finished.returncode and not is_partial:
        sys.exit(finished.returncode)
