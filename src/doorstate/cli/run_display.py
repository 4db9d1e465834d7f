# SPDX-License-Identifier: Apache-2.0
"""Live display of training runs, read from their folders."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.live import Live
from rich.table import Table
from rich.text import Text

from doorstate.cli.console import stderr
from doorstate.cli.progress import duration

if TYPE_CHECKING:
    from doorstate.training.comparison import RunSpec
    from doorstate.training.recipes import Recipe

_LOOK_PERIOD_S = 1.0  # between looks into the folders of the runs, where standard error is not a terminal


@contextmanager
def live_runs(
    runs: Sequence[RunSpec], recipes: Mapping[str, Recipe], num_points: int, jobs: int
) -> Iterator[Callable[[int, int], None]]:
    """Show the progress of runs on standard error; yields `update(done, total)`.

    A terminal gets a table that is refreshed once a second. Otherwise a line is printed for each epoch and each
    finished run.
    """
    display = RunDisplay(runs, recipes, num_points, jobs)
    if not stderr.is_terminal:
        epochs = EpochLines(runs, recipes)

        def print_line(done: int, total: int) -> None:
            epochs.print(display.time_left)
            if total > 1:
                stderr.print(f"{done} of {total} runs finished{display.time_left()}")

        with repeated(_LOOK_PERIOD_S, lambda: epochs.print(display.time_left)):
            yield print_line
        epochs.print(display.time_left)
        return
    with Live(get_renderable=display.table, console=stderr, refresh_per_second=1):
        yield lambda done, total: None


@contextmanager
def repeated(period_s: float, action: Callable[[], None]) -> Iterator[None]:
    """Call `action` periodically in a thread."""
    stopped = threading.Event()

    def repeat() -> None:
        while not stopped.wait(period_s):
            action()

    thread = threading.Thread(target=repeat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


class EpochLines:
    """Prints a line for each epoch that runs finish from now on.

    Args:
        runs: runs to follow.
        recipes: recipe of each network.
    """

    def __init__(self, runs: Sequence[RunSpec], recipes: Mapping[str, Recipe]) -> None:
        self._runs = [run for run in runs if run.method in recipes]
        self._recipes = recipes
        self._lock = threading.Lock()
        self._printed = [len(run.folder.read_log()) for run in self._runs]

    def print(self, time_left: Callable[[], str]) -> None:
        """Print the epochs that were finished since the last call."""
        with self._lock:
            for number, run in enumerate(self._runs):
                log = run.folder.read_log()
                for entry in log[self._printed[number] :]:
                    stderr.print(f"{self._line(run, entry)}{time_left()}")
                self._printed[number] = len(log)

    def _line(self, run: RunSpec, entry: Mapping[str, str]) -> str:
        parts = [
            f"{run.method}, fold {run.fold}: epoch {int(entry['epoch']) + 1} of {self._recipes[run.method].epochs}",
            f"{float(entry['seconds']):.0f} s",
        ]
        if entry.get("train_loss"):
            parts.append(f"loss {float(entry['train_loss']):.3f}")
        if entry.get("val_macro_f1"):
            parts.append(f"validation macro-F1 {float(entry['val_macro_f1']):.3f}")
        return ", ".join(parts)


class RunDisplay:
    """Table of methods by folds, with the score of finished runs and the progress of others.

    Args:
        runs: runs to show.
        recipes: recipe of each network.
        num_points: points of each cloud.
        jobs: number of runs at the same time.
    """

    def __init__(
        self, runs: Sequence[RunSpec], recipes: Mapping[str, Recipe], num_points: int, jobs: int
    ) -> None:
        self._runs, self._recipes, self._num_points, self._jobs = runs, recipes, num_points, jobs

    def table(self) -> Table:
        """Return the table as the run folders are now."""
        table = Table(title=f"test macro-F1, or epochs done{self.time_left()}", title_justify="left")
        table.add_column("method")
        for fold in sorted({run.fold for run in self._runs}):
            table.add_column(f"fold {fold}", justify="right", min_width=11)
        for method in dict.fromkeys(run.method for run in self._runs):
            table.add_row(method, *(self._cell(run) for run in self._runs if run.method == method))
        return table

    def time_left(self) -> str:
        """Return the estimated time left as text, empty until it can be estimated."""
        from doorstate.training.eta import eta_seconds

        seconds = eta_seconds(self._runs, self._recipes, self._num_points)
        at_once = max(1, min(self._jobs, sum(not run.folder.finished for run in self._runs)))
        return f", about {duration(seconds / at_once)} left" if seconds else ""

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
