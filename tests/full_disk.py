# SPDX-License-Identifier: Apache-2.0
"""A full disk for a test: temporary files beside the targets are links to `/dev/full`, which refuses every byte."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def full_disk(folder: Path) -> Iterator[None]:
    """Refuse every byte that is written to temporary files below a folder, with ENOSPC as the kernel gives it."""
    named = Path.with_name

    def with_name(path: Path, name: str) -> Path:
        temporary = named(path, name)
        if ".tmp." in name and temporary.is_relative_to(folder):
            temporary.symlink_to("/dev/full")
        return temporary

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "with_name", with_name)
        yield
