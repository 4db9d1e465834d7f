# SPDX-License-Identifier: Apache-2.0
"""The command that writes a network as ONNX, for robots without torch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.options import Weights
from doorstate.errors import ConfigError


def export(
    network: Annotated[
        str, typer.Argument(help="Packaged weights to export; with --weights the network that they are of.")
    ],
    weights: Weights = None,
    points: Annotated[
        int | None,
        typer.Option(help="Points that the file takes; as the weights ask for if not given.", min=128),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; NETWORK.onnx if not given.")] = None,
    opset: Annotated[int, typer.Option(help="Version of ONNX's operators.", min=18)] = 18,
    int8: Annotated[
        bool, typer.Option("--int8", help="Matrices as 8-bit integers: a smaller file, other probabilities.")
    ] = False,
    clouds: Annotated[int, typer.Option(help="Simulated clouds to compare with torch on.", min=3)] = 100,
) -> None:
    """Write a network as ONNX, checked and compared with torch on simulated clouds: points in, probabilities out.

    \b
    Examples:
      doorstate export pointnet2
      doorstate export pointnet2 --points 1024 --out robot/door.onnx
      doorstate export dgcnn --weights runs/paper/runs/dgcnn/fold0/weights.safetensors
      doorstate predict cloud.pcd --weights pointnet2.onnx
    """
    from doorstate._files import check_writable
    from doorstate.cli.console import out as stdout
    from doorstate.cli.console import progress_bar
    from doorstate.inference.export import TOLERANCE, check_installed, export_onnx
    from doorstate.inference.reference_clouds import reference_clouds
    from doorstate.networks.packaged import packaged_weights
    from doorstate.networks.weights import load_weights

    path = out or Path(f"{network}{'-int8' if int8 else ''}.onnx")
    if path.suffix != ".onnx":
        raise ConfigError(f"--out {path}: predict knows exported files by the ending .onnx")
    check_installed()
    check_writable(path)
    loaded, card = load_weights(weights or packaged_weights(network))
    if weights is not None and card.network != network:
        raise ConfigError(f"{weights}: weights of {card.network}, not of {network}")
    with progress_bar("Simulating clouds to compare on") as progress:
        compared_on = reference_clouds(clouds, points or card.points, progress)
    with progress_bar(f"Exporting {network}") as progress:
        found = export_onnx(path, loaded, card, compared_on, opset=opset, int8=int8, progress=progress)
    stdout.print(
        f"{path}: {path.stat().st_size / 1e6:.1f} MB, opset {opset}, {compared_on.points.shape[1]} points\n"
        f"{found.clouds} simulated clouds: largest difference from torch in a probability {found.largest:.1e}, "
        f"{found.right} states told right, by torch {found.right_in_torch}",
        soft_wrap=True,
    )
    if found.allowed > TOLERANCE and not int8:
        stdout.print(
            f"more than {TOLERANCE:.0e} is rounding here, which moves torch's own answers by {found.allowed / 2:.1e}",
            soft_wrap=True,
        )
