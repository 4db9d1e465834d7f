# SPDX-License-Identifier: Apache-2.0
"""Names of files: those in tables stay inside its folder, and those in output are safe to show."""

from __future__ import annotations

from pathlib import Path

from doorstate.errors import CloudReadError, DatasetError


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


def check_encoding(name: str) -> None:
    """Check that a table can hold the name of a file.

    Raises:
        CloudReadError: it is not in UTF-8.
    """
    # Python gives bytes that are not in UTF-8 as single surrogates.
    if not name.isascii() and any("\ud800" <= character <= "\udfff" for character in name):
        raise CloudReadError("its name is not in UTF-8", hint="rename it")


def csv_name(name: str) -> str:
    """Return a file name for a table that neither a spreadsheet nor a terminal obeys.

    One that begins as a formula begins with `./`, and still names the same file; JSON has the exact names of all.
    """
    return printable(f"./{name}" if name[:1] in ("=", "+", "-", "@", "\t", "\r") else name)


def printable(text: str) -> str:
    """Return text with control characters, terminal escapes and broken characters written as escape sequences."""
    return "".join(
        character
        if character.isprintable() or character == "\n"
        else character.encode("unicode_escape").decode("ascii")
        for character in text
    )
