# SPDX-License-Identifier: Apache-2.0
"""Consoles and tables of the command line: what a file name holds is printed, not obeyed."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from doorstate._paths import printable

_PLAIN: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False}  # file names may hold [ and :
_PIPE_WIDTH = 160  # characters; piped tables must not be folded to a narrow default
_NOT_IN_JSON = re.compile("[\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


class PrintingConsole(Console):
    """Console that prints lines as they are: not wrapped, without markup, and with nothing that a terminal obeys."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as `rich.console.Console.print` does, with printable text only."""
        super().print(*(printable(item) if isinstance(item, str) else item for item in objects), **options)

    def on_broken_pipe(self) -> None:
        """Leave it to `doorstate.cli.command` to end the program."""
        raise BrokenPipeError


stdout = PrintingConsole(**_PLAIN, soft_wrap=True)
stderr = PrintingConsole(**_PLAIN, soft_wrap=True, stderr=True)


def print_json(record: Mapping[str, Any]) -> None:
    """Print one JSON object as a line on standard output, at once."""
    print(json_line(record), flush=True)  # noqa: T201


def json_line(record: Mapping[str, Any]) -> str:
    """Return a JSON object in one line; characters that a terminal obeys are escaped, others are kept."""
    text = json.dumps(record, ensure_ascii=False)
    return _NOT_IN_JSON.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on standard output; all columns but the first are aligned to the right."""
    table = Table(title=printable(title) or None, title_justify="left")
    for position, column in enumerate(columns):
        table.add_column(column, justify="left" if position == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    PrintingConsole(**_PLAIN, width=None if sys.stdout.isatty() else _PIPE_WIDTH).print(table)


@contextmanager
def native_output_on_stderr() -> Iterator[None]:
    """Send what libraries of C write on standard output to standard error; what Python writes stays where it goes."""
    try:
        is_ours = sys.stdout.fileno() == 1
    except (OSError, ValueError):  # replaced by a program
        is_ours = False
    if not is_ours:
        yield
        return
    python_output = sys.stdout
    python_output.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = os.fdopen(
        os.dup(kept), "w", encoding=python_output.encoding, errors=python_output.errors, buffering=1
    )
    try:
        yield
        sys.stdout.flush()
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        own, sys.stdout = sys.stdout, python_output
        with suppress(OSError):
            own.close()
