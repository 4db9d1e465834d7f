# SPDX-License-Identifier: Apache-2.0
"""Consoles, progress bars and tables of the command line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

_PLAIN: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False}  # file names may hold [ and :
_PIPE_WIDTH = 160  # characters; piped tables must not be folded to a narrow default
stdout = Console(**_PLAIN)
stderr = Console(stderr=True, **_PLAIN)


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar on standard error, if that is a terminal; yields `update(done, total)`."""
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(compact=True),
        console=stderr,
        transient=not stderr.is_terminal,
        disable=not stderr.is_terminal,
    ) as progress:
        task = progress.add_task(description, total=None)

        def update(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        yield update


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on standard output; all columns but the first are aligned to the right."""
    table = Table(title=title or None, title_justify="left")
    for position, column in enumerate(columns):
        table.add_column(column, justify="left" if position == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(**_PLAIN, width=None if sys.stdout.isatty() else _PIPE_WIDTH).print(table)
