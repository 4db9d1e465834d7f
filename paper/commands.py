# SPDX-License-Identifier: Apache-2.0
"""`doorstate` commands that other tools run, shown as anybody can type them."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

from doorstate.dataset.store import is_prepared

REPOSITORY = Path(__file__).resolve().parents[1]


def doorstate(arguments: str, makes: Path | None = None) -> None:
    """Print and run one command in the repository; its error ends the tool.

    Args:
        arguments: after `doorstate`.
        makes: a prepared data set; where it is there in the end, exit code 1 says that some clouds were left out.
    """
    print(f"\n$ doorstate {arguments}", flush=True)
    program = Path(sys.executable).with_name("doorstate")
    finished = subprocess.run([program, *shlex.split(arguments)], cwd=REPOSITORY, check=False)
    left_some_out = finished.returncode == 1 and makes is not None and is_prepared(makes)
    if finished.returncode and not left_some_out:
        sys.exit(finished.returncode)
