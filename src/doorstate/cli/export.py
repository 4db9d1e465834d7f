# SPDX-License-Identifier: Apache-2.0
"""`doorstate export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doorstate.cli.options import NetworkNames, PointCount, WeightsFiles
from doorstate.errors import ConfigError


def export(
    network: NetworkNames = None,
    weights: WeightsFiles = None,
    points: PointCount = None,
    out: Annotated[Path | None, typer.Option(help="File to write. [default: NAME.onnx]")] = None,
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
      doorstate export
      doorstate export --network ogurob-dgcnn --points 1024 --out robot/door.onnx
      doorstate export --weights runs/paper/runs/dgcnn/fold0/weights.safetensors --out dgcnn.onnx
      doorstate predict cloud.pcd --weights pointnet2.onnx
    """
    from doorstate._files import check_writable
    from doorstate.cli.console import stdout
    from doorstate.cli.predictors import Methods, only_method
    from doorstate.cli.progress import progress_bar
    from doorstate.inference.export import TOLERANCE, export_onnx
    from doorstate.inference.reference_clouds import reference_clouds
    from doorstate.networks.card_file import read_card
    from doorstate.networks.packaged import packaged_weights
    from doorstate.networks.weights import load_weights

    name, source = only_method(Methods(network, weights))
    if out is not None and out.suffix != ".onnx":
        raise ConfigError(f"--out {out}: expected a .onnx file")
    file = source if isinstance(source, Path) else packaged_weights(name)
    path = out or Path(f"{read_card(file).network if source == file else name}{'-int8' if int8 else ''}.onnx")
    check_writable(path)
    loaded, card = load_weights(file)
    with progress_bar("Simulating clouds") as progress:
        references = reference_clouds(clouds, points or card.points_in_use, progress, card.input)
    with progress_bar(f"Exporting {name}") as progress:
        result = export_onnx(path, loaded, card, references, opset=opset, int8=int8, progress=progress)
    stdout.print(
        f"{path}: {path.stat().st_size / 1e6:.1f} MB, opset {opset}, {references.points.shape[1]} points\n"
        f"{result.num_clouds} simulated clouds: largest difference of a probability from torch "
        f"{result.max_difference:.1e}; {result.num_correct} correct states, {result.num_correct_torch} with torch",
    )
    if result.tolerance > TOLERANCE and not int8:
        stdout.print(
            f"differences above {TOLERANCE:.0e} come from rounding, which changes torch's own probabilities by "
            f"{result.tolerance / 2:.1e}",
        )
