# SPDX-License-Identifier: Apache-2.0
"""`doorstate export-sdf`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.errors import ConfigError


def export_sdf(
    source: Annotated[Path, typer.Argument(help="Simulated or prepared folder.")],
    samples: Annotated[list[str], typer.Argument(help="Samples to export, by their sample_id.")],
    out: Annotated[Path, typer.Option(help="Folder for the world files.")] = Path(),
) -> None:
    """Export simulated scenes for Gazebo.

    Each scene becomes an SDF world with its depth camera.

    \b
    Examples:
      doorstate export-sdf data/varied varied-0-00003-open
      doorstate export-sdf data/ogurob p0655-closed p0655-open --out worlds
    """
    from doorstate._files import read_csv, write_text
    from doorstate.cli.console import stdout
    from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
    from doorstate.simulation.sdf import sdf_world

    manifest = source / MANIFEST_FILE
    if not manifest.is_file():
        raise ConfigError(f"not a simulated folder: no {MANIFEST_FILE}", path=source)
    rows = {row.get("sample_id", ""): row for row in read_csv(manifest)}
    for sample in samples:
        if sample not in rows:
            raise ConfigError(f"no sample {sample!r}", path=manifest)
    for sample in samples:
        world = sdf_world(unflatten(rows[sample]), sample)
        write_text(out / f"{sample}.sdf", world)
        stdout.print(f"{out / sample}.sdf")
