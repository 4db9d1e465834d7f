# SPDX-License-Identifier: Apache-2.0
"""The command that tests finished weights on other data than their own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def transfer(
    study: Annotated[Path, typer.Argument(help="A study file.")],
    out: Annotated[Path | None, typer.Option(help="Folder of the study; runs/NAME if not given.")] = None,
    jobs: Annotated[int, typer.Option(help="Runs at the same time.", min=1)] = 1,
) -> None:
    """Test finished weights on data that none of them has seen; stopped at any moment, it goes on where it was.

    A study file is TOML: networks, num_points, a table [trained] of comparisons, whose fold 0 is tested, and a table
    [tested] of prepared data sets. `doorstate report FOLDER/TRAINED/TESTED` tells more of one pair.

    \b
    Examples:
      doorstate transfer paper/experiments/transfer.toml
      doorstate transfer paper/experiments/transfer.toml --jobs 2 --out runs/elsewhere
    """
    from doorstate.cli.console import out as stdout
    from doorstate.cli.console import print_table
    from doorstate.cli.training import compare_live
    from doorstate.evaluation.transfer import load_transfer_results, transfer_table, write_transfer
    from doorstate.training.transfer import load_transfer

    settings = load_transfer(study)
    folder = out or Path("runs") / settings.name
    cells = list(settings.cells())
    settings.write_splits(folder)
    for cell in cells:
        compare_live(cell.experiment, folder / cell.folder, jobs)
    results = load_transfer_results(folder, tuple(settings.trained), tuple(settings.tested))
    table = transfer_table(results)
    print_table(table.title, table.columns, table.rows)
    stdout.print(f"tables and figure: {write_transfer(results, folder / 'report')}", soft_wrap=True)
