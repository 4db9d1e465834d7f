# SPDX-License-Identifier: Apache-2.0
"""The command that writes a network as ONNX, for robots without torch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.options import Weights
from doorstate.errors import ConfigError

_CLOUDS = 24


def export(
    network: Annotated[str, typer.Argument(help="Network whose weights to export.")],
    weights: Weights = None,
    points: Annotated[
        int | None, typer.Option(help="Points that the file takes; as trained if not given.", min=128)
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; NETWORK.onnx if not given.")] = None,
    opset: Annotated[int, typer.Option(help="Version of ONNX's operators.", min=18)] = 18,
    int8: Annotated[
        bool, typer.Option("--int8", help="Matrices as 8-bit integers: a smaller file, other probabilities.")
    ] = False,
) -> None:
    """Write a network as ONNX, checked and compared with torch on 24 simulated clouds.

    \b
    Examples:
      doorstate export pointnet2
      doorstate export pointnet2 --points 1024 --out robot/door.onnx
      doorstate export dgcnn --weights runs/paper/runs/dgcnn/fold0/weights.safetensors
      doorstate predict cloud.pcd --weights pointnet2.onnx
    """
    from doorstate.console import out as stdout
    from doorstate.console import progress_bar
    from doorstate.deployment.onnx_export import comparison_clouds, export_onnx
    from doorstate.deployment.predictor import packaged_weights
    from doorstate.training.weights import load_weights

    path = out or Path(f"{network}{'-int8' if int8 else ''}.onnx")
    if path.suffix != ".onnx":
        raise ConfigError(f"--out {path}: predict knows exported files by the ending .onnx")
    loaded, card = load_weights(weights or packaged_weights(network))
    if card.network != network:
        raise ConfigError(f"{weights}: weights of {card.network}, not of {network}")
    with progress_bar("Simulating clouds to compare on") as progress:
        clouds = comparison_clouds(_CLOUDS, points or card.num_points, progress)
    with progress_bar(f"Exporting {network}") as progress:
        comparison = export_onnx(path, loaded, card, clouds, opset=opset, int8=int8, progress=progress)
    stdout.print(
        f"{path}: {path.stat().st_size / 1e6:.1f} MB, opset {opset}, {clouds.shape[1]} points\n"
        f"largest difference from torch in a probability: {comparison.largest:.1e}, "
        f"another state in {comparison.other_states} of {comparison.clouds} simulated clouds",
        soft_wrap=True,
    )
