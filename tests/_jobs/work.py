# SPDX-License-Identifier: Apache-2.0
"""Work of small jobs; processes of all engines import it."""

from __future__ import annotations

import os
import secrets
import signal
import time
from pathlib import Path

from doorstate._files import write_text
from doorstate.errors import DatasetError


def square(piece: int, path: Path) -> None:
    write_text(path, str(piece**2))


def square_of_positive(piece: int, path: Path) -> None:
    if piece < 0:
        raise DatasetError(
            f"{piece} is negative", path=path, field="piece", expected="0 or more", hint="try 3"
        )
    square(piece, path)


def killed(piece: int, path: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def killed_once(piece: int, path: Path) -> None:
    """Fails like a lost machine the first time, and writes a file that shows how often it was tried."""
    tries = path.with_suffix(".tries")
    tries.write_text(f"{tries.read_text() if tries.exists() else ''}x")
    if piece < 0 and len(tries.read_text()) == 1:
        killed(piece, path)
    square(piece, path)


def slow(piece: float, path: Path) -> None:
    """Sleeps for as many seconds."""
    path.with_suffix(f".started-{os.getpid()}").touch()
    time.sleep(piece)
    write_text(path, "done")


def gpus(piece: int, path: Path) -> None:
    time.sleep(0.2)  # so that every worker gets one
    write_text(path, visible_gpus(None, piece))


def visible_gpus(_: object, piece: int) -> str:
    return os.environ.get("CUDA_VISIBLE_DEVICES", "all")


def load_offset(offset: int, folder: Path) -> int:
    """Leaves a file for each call."""
    if not folder.is_dir():
        raise DatasetError("no folder", path=folder)
    folder.joinpath(secrets.token_hex(8)).touch()
    return offset


def plus_offset(offset: int, piece: int) -> tuple[int, int]:
    return piece, piece + offset
