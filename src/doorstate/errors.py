# SPDX-License-Identifier: Apache-2.0
"""Everything that can go wrong for a user, as one tree; the command line is the only catcher.

DoorstateError
├── CloudError             one input file or array cannot be used
│   ├── CloudReadError     unreadable, truncated, unknown format
│   └── CloudContentError  readable, but of another form or in wrong units
│       └── TooFewPointsError  empty, all NaN, or hardly anything measured
├── CameraError            intrinsics or depth settings missing or impossible
├── ConfigError            an option or experiment file asks for something that does not exist
├── DatasetError           a data set folder is missing, incomplete or inconsistent
├── RunError               a training run or comparison folder cannot be used or continued
├── WeightsError           a weights file is missing, damaged, or made for something else
├── ExportError            a network cannot be exported, or the file would answer otherwise
├── OutputError            a file cannot be written where it was asked for
└── MissingExtraError      an optional package is needed and not installed
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pydantic import ValidationError

MAX_MESSAGE_LENGTH = 1000  # letters: a file may name a million fields
_LONGEST_REASON = 160


class DoorstateError(Exception):
    """Root of the tree; `str(error)` is one line that says what was wrong, where, and what to do."""

    def __str__(self) -> str:
        # Files name their parts, and files have names: line breaks and terminal escapes among them.
        line = "".join(letter if letter.isprintable() else " " for letter in super().__str__())
        return line if len(line) <= MAX_MESSAGE_LENGTH else f"{line[: MAX_MESSAGE_LENGTH - 3]}..."


class CloudError(DoorstateError):
    """One input file or array cannot be used."""


class CloudReadError(CloudError):
    """The bytes could not be read as a cloud."""


class CloudContentError(CloudError):
    """The cloud was read, but holds nothing a door's state can be told from."""


class TooFewPointsError(CloudContentError):
    """Too little was measured: a moment of the camera's, and not how its clouds are read."""


class CameraError(DoorstateError):
    """Camera intrinsics, depth scale or roll are missing or impossible."""


class ConfigError(DoorstateError):
    """An option or experiment file asks for something that does not exist."""


class DatasetError(DoorstateError):
    """A data set folder is missing, incomplete or inconsistent."""


class RunError(DoorstateError):
    """A training run or comparison folder cannot be used or continued."""


class WeightsError(DoorstateError):
    """A weights file is missing, damaged, or made for another network."""


class ExportError(DoorstateError):
    """A network cannot be exported, or the file would answer otherwise."""


class OutputError(DoorstateError):
    """A file cannot be written where it was asked for."""


class MissingExtraError(DoorstateError):
    """An optional package is needed and not installed."""


def missing_extra(what: str, *packages: str) -> MissingExtraError:
    """What cannot be done, and how it can: by the packages' own names, as doorstate is on no index."""
    return MissingExtraError(f"{what} needs what is not installed: pip install {' '.join(packages)}")


def first_validation_error(error: ValidationError, fields: Iterable[str] = ()) -> str:
    """Where the first problem of values lies, if not in the whole, and what it is; with all fields if one is wrong."""
    problem = error.errors()[0]
    told = ": ".join(filter(None, [".".join(map(str, problem["loc"])), problem["msg"]]))
    named = ", ".join(fields) if problem["type"] in ("missing", "extra_forbidden") else ""
    return f"{told}; fields are {named}" if named else told


def summarize_exception(error: Exception) -> str:
    """What another library says, in one line that is not long."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:_LONGEST_REASON]
