# SPDX-License-Identifier: Apache-2.0
"""`doorstate report`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.engine_options import EngineOptions, with_engine_options
from doorstate.errors import DatasetError


@with_engine_options
def report(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER...", help="Comparisons or runs of the same samples, or one prepared data set."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write to. [default: report in the first FOLDER]")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Data set of the comparisons or runs, if it was moved.")
    ] = None,
    *,
    engine: EngineOptions,
) -> None:
    """Write a report of comparisons, of one run, or of one data set.

    The folder gets tables and figures; that of comparisons and runs also a self-contained HTML page.

    \b
    Examples:
      doorstate report runs/one-fold
      doorstate report runs/first
      doorstate report runs/paper runs/related --out reports/all
      doorstate report data/ogurob-4096 --out reports/data
    """
    from doorstate.cli.console import stdout
    from doorstate.cli.progress import progress_bar
    from doorstate.dataset.store import is_prepared
    from doorstate.evaluation.predictions import has_results
    from doorstate.evaluation.report import write_dataset_report, write_report

    is_dataset = len(folders) == 1 and not has_results(folders[0])
    if is_dataset and not is_prepared(folders[0]):
        raise DatasetError("no comparison, no run and no prepared data set", path=folders[0])
    target = out or folders[0] / "report"
    opened = nullcontext(1) if engine.is_default else engine.open()
    with opened as workers, progress_bar("Writing the report") as progress:
        if is_dataset:
            page = write_dataset_report(folders[0], target, workers, progress)
        else:
            page = write_report(folders, target, data, workers=workers, progress=progress)
    stdout.print(f"report: {page}")
