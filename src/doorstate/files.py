# SPDX-License-Identifier: Apache-2.0
"""Files appear whole or not at all: write beside the target, then rename."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Give a temporary path beside `target` that replaces it when the block ends without an error."""
    target.parent.mkdir(parents=True, exist_ok=True)
    # The target's ending stays last: writers such as numpy and matplotlib choose the format by it.
    temporary = target.with_name(f".{os.getpid()}.tmp.{target.name}")
    try:
        yield temporary
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def is_vacant(folder: Path) -> bool:
    """Whether something new may be made here: nothing is there, or at most what a killed write left behind."""
    return not folder.exists() or (folder.is_dir() and all(".tmp." in path.name for path in folder.iterdir()))


def write_text(target: Path, text: str) -> None:
    """Write `text` as UTF-8 in one step."""
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
