# SPDX-License-Identifier: Apache-2.0
"""`doorstate export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.errors import ConfigError


def export(
    network: Annotated[
        str, typer.Argument(help="Name of packaged weights, or the architecture of --weights.")
    ],
    weights: Annotated[
        Path | None, typer.Option(help="Weights file (.safetensors), instead of packaged weights.")
    ] = None,
    points: Annotated[
        int | None, typer.Option(help="Points that the file takes. [default: as trained]", min=128)
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write. [default: NETWORK.onnx]")] = None,
    opset: Annotated[int, typer.Option(help="Version of the ONNX operator set.", min=18)] = 18,
    int8: Annotated[
        bool, typer.Option("--int8", help="Store matrices as 8-bit integers: smaller, but less exact.")
    ] = False,
    clouds: Annotated[
        int, typer.Option(help="Number of simulated clouds for the comparison with torch.", min=3)
    ] = 100,
) -> None:
    """Export a network to ONNX.

    The file takes points and returns probabilities; it needs onnxruntime, but not torch. Its probabilities are compared
    with those of torch on simulated clouds.

    \b
    Examples:
      doorstate export pointnet2
      doorstate export pointnet2 --points 1024 --out robot/door.onnx
      doorstate export dgcnn --weights runs/paper/runs/dgcnn/fold0/weights.safetensors
      doorstate predict cloud.pcd --weights pointnet2.onnx
    """
    from doorstate._files import check_writable
    from doorstate.cli.console import progress_bar, stdout
    from doorstate.inference.export import TOLERANCE, check_export_packages, export_onnx
    from doorstate.inference.reference_clouds import reference_clouds
    from doorstate.networks.packaged import packaged_weights
    from doorstate.networks.weights import load_weights

    path = out or Path(f"{network}{'-int8' if int8 else ''}.onnx")
    if path.suffix != ".onnx":
        raise ConfigError(f"--out {path}: expected a .onnx file")
    check_export_packages()
    check_writable(path)
    loaded, card = load_weights(weights or packaged_weights(network))
    if weights is not None and card.network != network:
        raise ConfigError(f"the weights are of {card.network}, not of {network}", path=weights)
    with progress_bar("Simulating clouds") as progress:
        references = reference_clouds(clouds, points or card.points_in_use, progress)
    with progress_bar(f"Exporting {network}") as progress:
        result = export_onnx(path, loaded, card, references, opset=opset, int8=int8, progress=progress)
    stdout.print(
        f"{path}: {path.stat().st_size / 1e6:.1f} MB, opset {opset}, {references.points.shape[1]} points\n"
        f"{result.num_clouds} simulated clouds: largest difference of a probability from torch "
        f"{result.max_difference:.1e}; {result.num_correct} correct states, {result.num_correct_torch} with torch",
        soft_wrap=True,
    )
    if result.tolerance > TOLERANCE and not int8:
        stdout.print(
            f"differences above {TOLERANCE:.0e} come from rounding, which changes torch's own probabilities by "
            f"{result.tolerance / 2:.1e}",
            soft_wrap=True,
        )
