# SPDX-License-Identifier: Apache-2.0
"""What the command line shows: progress bars, tables, the live state of a comparison."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.live import Live
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

if TYPE_CHECKING:
    from doorstate.training.comparison import Run

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


def _columns() -> tuple[TextColumn, BarColumn, MofNCompleteColumn, TimeElapsedColumn, TimeRemainingColumn]:
    return (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(compact=True),
    )


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error; yields `update(done, total)`. Where nobody looks it prints nothing."""
    with Progress(
        *_columns(), console=err, transient=not err.is_terminal, disable=not err.is_terminal
    ) as progress:
        task = progress.add_task(description, total=None)

        def update(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        yield update


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on standard output; the first column is text, the others are numbers."""
    table = Table(title=title or None, title_justify="left")
    for position, column in enumerate(columns):
        table.add_column(column, justify="left" if position == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    # Piped output is not folded to a terminal that is not there.
    Console(highlight=False, width=None if sys.stdout.isatty() else 160).print(table)


@contextmanager
def live_runs(
    runs: Sequence[Run], epochs: Mapping[str, int], jobs: int
) -> Iterator[Callable[[int, int], None]]:
    """Show how far every run is, read from the run folders once a second; yields `update(done, total)`.

    Where nobody looks, finished runs are counted in plain lines instead.
    """
    if not err.is_terminal:

        def say(done: int, total: int) -> None:
            err.print(f"{done} of {total} runs finished")

        yield say
        return
    watch = _RunWatch(runs, epochs, jobs)
    with Live(get_renderable=watch.table, console=err, refresh_per_second=1):
        yield lambda done, total: None


class _RunWatch:
    def __init__(self, runs: Sequence[Run], epochs: Mapping[str, int], jobs: int) -> None:
        self._runs, self._epochs, self._jobs = runs, epochs, jobs

    def table(self) -> Table:
        folds = sorted({run.fold for run in self._runs})
        table = Table(
            title=f"macro-F1 on the test fold, or epochs done{self._time_left()}", title_justify="left"
        )
        table.add_column("network")
        for fold in folds:
            table.add_column(f"fold {fold}", justify="right", min_width=11)
        for network in dict.fromkeys(run.network for run in self._runs):
            cells = [self._cell(run) for run in self._runs if run.network == network]
            table.add_row(network, *cells)
        return table

    def _cell(self, run: Run) -> str:
        if run.folder.finished:
            return f"[green]{run.folder.read_metrics()['test_macro_f1']:.4f}[/green]"
        position = run.folder.read_position()
        if not position:
            return "[dim]-[/dim]"
        return f"{position:.1f} / {self._epochs[run.network]}"

    def _time_left(self) -> str:
        """Seconds of one epoch, as far as known, times the epochs that are left."""
        seconds: dict[str, float] = {}
        for run in self._runs:
            if run.folder.finished:
                seconds[run.network] = run.folder.read_metrics()["seconds"] / self._epochs[run.network]
            elif run.network not in seconds and run.folder.log.is_file():
                seconds[run.network] = run.folder.last_epoch_seconds()
        if not seconds:
            return ""
        known = sum(seconds.values()) / len(seconds)
        left = sum(
            seconds.get(run.network, known) * (self._epochs[run.network] - run.folder.read_position())
            for run in self._runs
            if not run.folder.finished
        )
        return f", about {left / self._jobs / 60:.0f} min left"
