# SPDX-License-Identifier: Apache-2.0
"""What the command line shows: progress bars, tables, the live state of a comparison."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

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
from rich.text import Text

if TYPE_CHECKING:
    from doorstate.training.comparison import RunSpec
    from doorstate.training.recipes import Recipe

# Names of files are printed as they are: brackets and colons in them mean nothing.
_PLAIN: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False}
out = Console(**_PLAIN)
err = Console(stderr=True, **_PLAIN)
_LINE_EVERY_S = 600.0  # where nobody looks, but somebody may read a log


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error; yields `update(done, total)`. Where nobody looks it prints nothing."""
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(compact=True),
        console=err,
        transient=not err.is_terminal,
        disable=not err.is_terminal,
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
    Console(**_PLAIN, width=None if sys.stdout.isatty() else 160).print(table)


@contextmanager
def live_runs(
    runs: Sequence[RunSpec], recipes: Mapping[str, Recipe], num_points: int, jobs: int
) -> Iterator[Callable[[int, int], None]]:
    """Show how far every run is, read from the run folders once a second; yields `update(done, total)`.

    Where nobody looks, finished runs are counted in plain lines instead, and every ten minutes.
    """
    watch = _RunWatch(runs, recipes, num_points, jobs)
    if not err.is_terminal:

        def say(done: int, total: int) -> None:
            err.print(f"{done} of {total} runs finished{watch.time_left()}", soft_wrap=True)

        with _every(_LINE_EVERY_S, lambda: say(sum(run.folder.finished for run in runs), len(runs))):
            yield say
        return
    with Live(get_renderable=watch.table, console=err, refresh_per_second=1):
        yield lambda done, total: None


@contextmanager
def _every(seconds: float, act: Callable[[], None]) -> Iterator[None]:
    over = threading.Event()

    def keep_acting() -> None:
        while not over.wait(seconds):
            act()

    thread = threading.Thread(target=keep_acting, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


class _RunWatch:
    def __init__(
        self, runs: Sequence[RunSpec], recipes: Mapping[str, Recipe], num_points: int, jobs: int
    ) -> None:
        self._runs, self._recipes, self._num_points, self._jobs = runs, recipes, num_points, jobs

    def table(self) -> Table:
        folds = sorted({run.fold for run in self._runs})
        table = Table(
            title=f"macro-F1 on the test fold, or epochs done{self.time_left()}", title_justify="left"
        )
        table.add_column("network")
        for fold in folds:
            table.add_column(f"fold {fold}", justify="right", min_width=11)
        for network in dict.fromkeys(run.method for run in self._runs):
            cells = [self._cell(run) for run in self._runs if run.method == network]
            table.add_row(network, *cells)
        return table

    def time_left(self) -> str:
        """How long the rest will take, once that can be said."""
        from doorstate.training.eta import eta_seconds

        seconds = eta_seconds(self._runs, self._recipes, self._num_points)
        return f", about {seconds / self._jobs / 60:.0f} min left" if seconds else ""

    def _cell(self, run: RunSpec) -> Text:
        if run.folder.finished:
            score = run.folder.read_metrics().get("test_macro_f1")
            return Text("done" if score is None else f"{score:.4f}", "green")
        position = run.folder.read_position()
        if not position:
            return Text("-", "dim")
        if run.method not in self._recipes:  # a rule
            return Text(f"{position:.0%}")
        return Text(f"{position:.1f} / {self._recipes[run.method].epochs}")
