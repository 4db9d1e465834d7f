# SPDX-License-Identifier: Apache-2.0
"""`doorstate join`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def join(
    sources: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Prepared data sets.")],
    out: Annotated[Path, typer.Option(help="Folder to create.")],
) -> None:
    """Join prepared data sets into one.

    \b
    Example:
      doorstate join data/varied-4096 data/cluttered-4096 data/no-door-4096 --out data/mixture-4096
    """
    from doorstate.cli.console import stdout
    from doorstate.dataset.join import join_datasets

    joined = join_datasets(sources, out)
    stdout.print(f"{len(joined)} clouds of {joined.num_points} points in {out}")
