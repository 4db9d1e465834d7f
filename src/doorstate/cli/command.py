# SPDX-License-Identifier: Apache-2.0
"""Behaviour that all commands share: choices in the help, and one line for what ends a command early."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from typer.core import TyperCommand

from doorstate.cli.choices import fill_in
from doorstate.cli.flags import format_flag
from doorstate.cli.signals import raise_in
from doorstate.errors import ConfigError, DoorstateError, needs_extra

CLOSED_PIPE = 141  # exit code of programs that SIGPIPE ends
_RESUMABLE = {"simulate", "prepare", "train", "adapt", "compare", "resolution", "transfer", "label"}


class Command(TyperCommand):
    """Command whose help lists the names that an option takes."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options, with the choices of those that have them."""
        for option in self.params:
            if text := getattr(option, "help", None):
                option.help = fill_in(text)  # type: ignore[attr-defined]  # arguments have one too
        super().format_options(ctx, formatter)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; a signal or a closed pipe ends it before typer handles them without a word."""
        advice = "; run the same command again to continue" if self.name in _RESUMABLE else ""
        try:
            return raise_in(lambda: super(Command, self).invoke(ctx), advice)
        except BrokenPipeError:
            _discard_output()
            raise SystemExit(CLOSED_PIPE) from None


@contextmanager
def reported_errors() -> Iterator[None]:
    """Print an error of this package, or of writing to standard output, as one line, and end the program."""
    _open_closed_streams()
    try:
        try:
            with needs_extra("this command"):
                yield
        finally:
            sys.stdout.flush()
    except DoorstateError as error:
        _print_error(error.describe(format_flag))
        sys.exit(2 if isinstance(error, ConfigError) else 1)
    except BrokenPipeError:
        _discard_output()
        sys.exit(CLOSED_PIPE)
    except MemoryError:
        _print_error("there is not enough memory")
        sys.exit(1)
    except OSError as error:
        if error.filename is not None:
            _print_error(f"{error.filename}: cannot be used ({error.strerror or error})")
            sys.exit(1)
        _discard_output()
        _print_error(f"the output cannot be written ({error.strerror or error})")
        sys.exit(1)


def _open_closed_streams() -> None:
    """Let streams that were closed at the start fail as a full disk does; else a file could take their number."""
    if sys.stdout is None:
        os.dup2(os.open(os.devnull, os.O_RDONLY), 1)
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
    if sys.stderr is None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)


def _print_error(text: str) -> None:
    print(f"doorstate: {text}", file=sys.stderr)  # noqa: T201


def _discard_output() -> None:
    """Let the interpreter write what is left of standard output to nowhere, when it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
