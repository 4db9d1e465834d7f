# SPDX-License-Identifier: Apache-2.0
"""The command that writes simulated scenes as worlds for Gazebo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.errors import ConfigError


def export_sdf(
    source: Annotated[Path, typer.Argument(help="A simulated or prepared folder.")],
    samples: Annotated[list[str], typer.Argument(help="sample_id of the rows to export.")],
    out: Annotated[Path, typer.Option(help="Folder for the worlds.")] = Path(),
) -> None:
    """Write simulated scenes as SDF worlds with their depth camera, for Gazebo.

    \b
    Examples:
      doorstate export-sdf data/varied varied-0-00003-open
      doorstate export-sdf data/ogurob p0655-closed p0655-open --out worlds
    """
    from doorstate._files import read_csv, write_text
    from doorstate.cli.console import out as stdout
    from doorstate.simulation.manifest import unflatten
    from doorstate.simulation.run import MANIFEST
    from doorstate.simulation.sdf import sdf_world

    if not (source / MANIFEST).is_file():
        raise ConfigError(f"{source}: is no simulated folder: it has no {MANIFEST}")
    rows = {row.get("sample_id", ""): row for row in read_csv(source / MANIFEST)}
    for sample in samples:
        if sample not in rows:
            raise ConfigError(f"{source / MANIFEST}: holds no sample {sample!r}")
    for sample in samples:
        world = sdf_world(unflatten(rows[sample]), sample)
        write_text(out / f"{sample}.sdf", world)
        stdout.print(f"{out / sample}.sdf", soft_wrap=True)
