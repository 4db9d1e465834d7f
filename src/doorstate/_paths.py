# SPDX-License-Identifier: Apache-2.0
"""Names of files in tables, which stay inside the folder of their table."""

from __future__ import annotations

from pathlib import Path

from doorstate.errors import DatasetError


def resolve_inside(folder: Path, name: str) -> Path:
    """Return the path of a file that a table of a folder names.

    Args:
        folder: folder of the table.
        name: relative path; links are followed, and must end inside the folder too.

    Raises:
        DatasetError: the name is absolute, or leads out of the folder.
    """
    path = folder / name
    try:
        is_inside = not Path(name).is_absolute() and path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, or a null byte
        raise DatasetError(f"{name!r} is no path ({error})", path=folder) from error
    if not is_inside:
        raise DatasetError(
            f"{name!r} is outside of the folder", path=folder, expected="a relative path to a file inside"
        )
    return path
