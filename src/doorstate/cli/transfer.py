# SPDX-License-Identifier: Apache-2.0
"""`doorstate transfer`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.engine_options import EngineOptions, with_runs_options


@with_runs_options
def transfer(
    study: Annotated[Path, typer.Argument(help="Study file (TOML).")],
    out: Annotated[Path | None, typer.Option(help="Folder of the study. [default: runs/NAME]")] = None,
    *,
    runs: EngineOptions,
) -> None:
    """Test trained networks on other data sets.

    A study file has the keys networks and num_points, a table [trained] of comparisons (their fold 0 is tested) and a
    table [tested] of prepared data sets. `doorstate report FOLDER/TRAINED/TESTED` reports one pair. An interrupted
    study continues where it stopped.

    \b
    Examples:
      doorstate transfer paper/experiments/transfer.toml
      doorstate transfer paper/experiments/transfer.toml --jobs 2 --out runs/elsewhere
    """
    from doorstate._locks import owned_folder
    from doorstate.cli.compare import compare_with_display
    from doorstate.cli.console import print_table, stdout
    from doorstate.evaluation.study import load_study_results
    from doorstate.evaluation.transfer import score_transfer, transfer_table, write_transfer
    from doorstate.training.study import load_study
    from doorstate.training.transfer import TransferStudy

    settings = load_study(study, TransferStudy)
    folder = out or Path("runs") / settings.name
    parts = list(settings.parts())
    with owned_folder(folder), runs.open() as engine:
        settings.prepare(folder)
        for part in parts:
            compare_with_display(part.experiment, folder / part.folder, engine, runs.resources, runs.device)
    results = load_study_results(folder)
    scores = score_transfer(results, tuple(settings.trained), tuple(settings.tested))
    table = transfer_table(scores)
    print_table(table.title, table.columns, table.rows)
    stdout.print(f"tables and figure: {write_transfer(scores, folder / 'report')}")
