# SPDX-License-Identifier: Apache-2.0
"""Errors that a user can cause, as one tree; commands, service and node catch them and word them in their own terms.

DoorstateError
├── CloudError             one input file or array cannot be used
│   ├── CloudReadError     unreadable, truncated, unknown format
│   └── CloudContentError  readable, but of another form or in wrong units
│       └── TooFewPointsError  empty, all NaN, or hardly anything measured
├── CameraError            intrinsics or depth settings missing or impossible
│   └── CameraGoneError    an attached camera is not there, or not any more
├── ConfigError            an option or experiment file asks for something that does not exist
├── DatasetError           a data set folder is missing, incomplete or inconsistent
├── RunError               a training run or comparison folder cannot be used or continued
├── WeightsError           a weights file is missing, damaged, or made for another network
├── ExportError            a network cannot be exported, or the exported file disagrees with it
├── BrokerError            a broker of MQTT refuses the connection
├── DoorFileError          a list of doors, poses of a camera, or a history of doors cannot be used
├── OutputError            a file cannot be written
│   └── FolderInUseError   another process writes the folder
└── MissingExtraError      an optional package is needed and not installed
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from pydantic import ValidationError

MAX_MESSAGE_LENGTH = 1000  # characters; a file may name a million fields
_MAX_REASON_LENGTH = 160

WriteParameter = Callable[[str, object], str]
"""Writes a parameter's name, and the value to give it unless that is None, as a surface spells them."""


def python_parameter(name: str, value: object = None) -> str:
    """Write a parameter as a Python keyword argument."""
    return name if value is None else f"{name}={value!r}"


class DoorstateError(Exception):
    """Base of all errors of this package.

    Args:
        message: what is wrong, in words that name no command and no option.
        path: file or folder with the problem.
        field: parameter, column or key with the problem, by its name in Python or in the file.
        expected: what would be accepted instead.
        hint: what to do about it, in words that every surface can use.
        suggestions: parameters by name and the values to try, such as `{"frame": "optical"}`.
    """

    def __init__(
        self,
        message: str,
        *,
        path: str | Path | None = None,
        field: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
        suggestions: Mapping[str, object] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.path = path
        self.field = field
        self.expected = expected
        self.hint = hint
        self.suggestions = dict(suggestions or {})

    def __str__(self) -> str:
        return self.describe()

    def describe(self, parameter: WriteParameter = python_parameter, *, with_path: bool = True) -> str:
        """Return one printable line: place, problem, what is expected, what to do.

        Args:
            parameter: writes a parameter as the surface spells it.
            with_path: start with the path, where there is one.
        """
        place = [] if self.path is None or not with_path else [str(self.path)]
        if self.field is not None:
            # A key of a file is written as in the file, anything else as the surface writes parameters.
            place.append(self.field if self.path is not None else parameter(self.field, None))
        tries = " ".join(parameter(name, value) for name, value in self.suggestions.items())
        advice = [
            self.expected and f"expected {self.expected}",
            self.hint,
            tries and f"try {tries}",
        ]
        line = "; ".join([": ".join([*place, self.message]), *filter(None, advice)])
        # Files name their parts, and files have names: line breaks and terminal escapes among them.
        line = "".join(character if character.isprintable() else " " for character in line)
        return line if len(line) <= MAX_MESSAGE_LENGTH else f"{line[: MAX_MESSAGE_LENGTH - 3]}..."

    def located(self, path: str | Path) -> Self:
        """Return the same error with the path of the file or folder, where the code that raised it had none."""
        return type(self)(self.message, **self._fields() | {"path": path})

    def _fields(self) -> dict[str, Any]:
        names = ("path", "field", "expected", "hint", "suggestions")
        return {name: getattr(self, name) for name in names}

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.message, **self._fields()), ()


class CloudError(DoorstateError):
    """One input file or array cannot be used."""


class CloudReadError(CloudError):
    """The bytes cannot be read as a cloud."""


class CloudContentError(CloudError):
    """The cloud can be read, but not used: wrong shape, unit or frame."""


class TooFewPointsError(CloudContentError):
    """Too little was measured, for the moment; other clouds of the same camera may be fine."""


class CameraError(DoorstateError):
    """Camera intrinsics, depth scale or roll are missing or impossible."""


class CameraGoneError(CameraError):
    """An attached camera is not there, or not any more; it may come back."""


class ConfigError(DoorstateError):
    """An option or experiment file asks for something that does not exist."""


class DatasetError(DoorstateError):
    """A data set folder is missing, incomplete or inconsistent."""


class RunError(DoorstateError):
    """A training run or comparison folder cannot be used or continued."""


class WeightsError(DoorstateError):
    """A weights file is missing, damaged, or made for another network."""


class ExportError(DoorstateError):
    """A network cannot be exported, or the exported file disagrees with it."""


class BrokerError(DoorstateError):
    """A broker of MQTT refuses the connection."""


class DoorFileError(DoorstateError):
    """A list of doors, poses of a camera, or a history of doors cannot be used."""


class OutputError(DoorstateError):
    """A file cannot be written."""


class FolderInUseError(OutputError):
    """Another process or thread works in an output folder."""


class MissingExtraError(DoorstateError):
    """An optional package is needed and not installed."""


EXTRAS = {
    "train": (
        "torch",
        "lightning_fabric",
        "safetensors",
        "sklearn",
        "pandas",
        "statsmodels",
        "matplotlib",
        "jinja2",
    ),
    "onnx": ("onnx", "onnxscript"),
    "serve": ("fastapi", "uvicorn", "prometheus_client", "jinja2"),
    "bags": ("rosbags",),
    "cluster": ("ray",),
    "mqtt": ("paho",),
    "realsense": ("pyrealsense2",),
    "oak": ("depthai",),
    "orbbec": ("pyorbbecsdk",),
    "openni": ("openni",),
}
"""Modules of the optional dependencies, by the name of the extra that installs them (pyproject.toml)."""


def missing_extra(feature: str, extra: str) -> MissingExtraError:
    """Return the error of a feature whose extra, a name of `EXTRAS`, is not installed."""
    return MissingExtraError(
        f"{feature} needs packages that are not installed", hint=f'pip install "doorstate[{extra}]"'
    )


def check_extra(feature: str, extra: str, *modules: str) -> None:
    """Check, without importing anything, that modules of an extra are installed; all of the extra if none is given.

    Raises:
        MissingExtraError: one of them is not.
    """
    if not all(map(is_installed, modules or EXTRAS[extra])):
        raise missing_extra(feature, extra)


@contextmanager
def needs_extra(feature: str) -> Iterator[None]:
    """Name the extra where a package that is imported in the block is not installed.

    Raises:
        MissingExtraError: a package of an extra is missing; other errors pass.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        extra = next((extra for extra, modules in EXTRAS.items() if module in modules), None)
        if extra is None:
            raise
        raise missing_extra(feature, extra) from error


def is_installed(module: str) -> bool:
    """Return True if a top-level module can be imported, without importing it."""
    try:
        return module in sys.modules or find_spec(module) is not None
    except ImportError:
        return False


def unknown_name(
    kind: str,
    name: str,
    names: Iterable[str],
    error: type[DoorstateError] = ConfigError,
    *,
    field: str | None = None,
) -> DoorstateError:
    """Return the error of a name that does not exist, with the closest name or all names.

    Args:
        kind: kind of thing, such as "network".
        name: the unknown name.
        names: all names that exist.
        error: class of the error.
        field: parameter that holds the name.
    """
    names = list(names)
    alike = {other.lower(): other for other in names}
    close = [alike[match] for match in get_close_matches(name.lower(), alike, n=1)]
    close += [other for other in names if name.lower() in other.lower()]
    hint = f"did you mean {close[0]!r}?" if close else f"names are {', '.join(names) or 'none'}"
    return error(f"unknown {kind} {name!r}", field=field, hint=hint)


def first_validation_error(error: ValidationError, fields: Iterable[str] = ()) -> str:
    """Return the place and text of the first problem, and all fields if one is missing or unknown."""
    problem = error.errors()[0]
    # Of a validator of ours; pydantic writes "Value error, " before it.
    own = problem.get("ctx", {}).get("error")
    text = ": ".join(filter(None, [".".join(map(str, problem["loc"])), str(own or problem["msg"])]))
    listed = ", ".join(fields) if problem["type"] in ("missing", "extra_forbidden") else ""
    return f"{text}; fields are {listed}" if listed else text


def summarize_exception(error: Exception) -> str:
    """Return the type and text of another library's exception, in one line; ... stands for the end of a long one."""
    text = f"{type(error).__name__}: {error}"[:MAX_MESSAGE_LENGTH]
    return shorten(text, _MAX_REASON_LENGTH, placeholder=" ...")
