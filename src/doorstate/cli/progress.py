# SPDX-License-Identifier: Apache-2.0
"""Progress on standard error: bars on a terminal, and lines at growing intervals where there is none."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from doorstate.cli import console

Update = Callable[[int, int], None]
"""Takes the number of things done and their total."""

FIRST_LINE_S = 2.0
_LONGEST_PAUSE_S = 60.0


@contextmanager
def progress_bar(description: str, *, hidden: bool = False) -> Iterator[Update]:
    """Show progress on standard error; yields `update(done, total)`.

    A terminal gets a bar. Otherwise a line is printed after 2, 4, 8, ... seconds, and then every minute.

    Args:
        description: present participle of the work, such as "Simulating".
        hidden: show nothing.
    """
    if hidden:
        yield lambda done, total: None
        return
    if not console.stderr.is_terminal:
        yield line_progress(description)
        return
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(compact=True),
        console=console.stderr,
    ) as progress:
        task = progress.add_task(description, total=None)

        def update(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        yield update


def line_progress(description: str, clock: Callable[[], float] = time.monotonic) -> Update:
    """Return an update that prints a line now and then, and none for work of two seconds.

    Args:
        description: present participle of the work.
        clock: seconds.
    """
    started, due_s = clock(), FIRST_LINE_S

    def update(done: int, total: int) -> None:
        nonlocal due_s
        elapsed_s = clock() - started
        if elapsed_s < due_s or not 0 < done < total:
            return
        left = duration(elapsed_s / done * (total - done))
        console.stderr.print(f"{description}: {done} of {total}, about {left} left")
        due_s = elapsed_s + min(elapsed_s, _LONGEST_PAUSE_S)

    return update


@contextmanager
def working(description: str) -> Iterator[None]:
    """Show that something is going on whose length is not known: a spinner, or a line after two seconds."""
    if console.stderr.is_terminal:
        with console.stderr.status(description):
            yield
        return
    timer = threading.Timer(FIRST_LINE_S, console.stderr.print, [f"{description} ..."])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def duration(seconds: float) -> str:
    """Return a time as a short text, such as `40 s`, `12 min` or `3.5 h`."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
