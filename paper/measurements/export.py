# SPDX-License-Identifier: Apache-2.0
"""Agreement of exported networks with torch, in float32 and with 8-bit matrices."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from doorstate._jobs import Progress
from doorstate.errors import ExportError
from doorstate.evaluation.table import UNDEFINED, Table
from doorstate.inference.export import TOLERANCE, Parity, export_onnx
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks.weights import load_weights

RUNTIMES = ("onnxruntime", "onnxruntime int8")


class ExportResult(NamedTuple):
    """One exported network; without `parity` it was not written."""

    network: str
    runtime: str
    clouds: int
    megabytes: float = 0.0
    parity: Parity | None = None


def measure_export(weights: Path, clouds: LabelledClouds, progress: Progress) -> list[ExportResult]:
    """Export a network in both precisions and compare it with torch on the same clouds."""
    network, card = load_weights(weights)
    results = []
    with TemporaryDirectory() as folder:
        for runtime in RUNTIMES:
            path = Path(folder) / f"{card.network}.onnx"
            result = ExportResult(card.network, runtime, len(clouds.points))
            try:
                parity = export_onnx(path, network, card, clouds, int8="int8" in runtime, progress=progress)
            except ExportError:
                results.append(result)
                continue
            results.append(result._replace(megabytes=path.stat().st_size / 1e6, parity=parity))
    return results


def export_table(results: Sequence[ExportResult]) -> Table:
    """Return one row per network and precision."""
    return Table(
        "Exported networks beside torch",
        (
            "network",
            "runtime",
            "MB",
            "states correct",
            "in torch",
            "largest difference",
            "rounding in torch",
        ),
        tuple((result.network, result.runtime, *_cells(result)) for result in results),
        "Differences are those of a probability, on simulated doors of no data set. Where one is above "
        f"{TOLERANCE:.0e}, the last column is the change of torch's own probabilities when the last digits of the "
        "points change, or everything is computed in float64.",
        text_columns=2,
    )


def _cells(result: ExportResult) -> tuple[str, ...]:
    parity = result.parity
    if parity is None:
        return ("not written", *[UNDEFINED] * 4)
    rounding = parity.tolerance / 2 if parity.tolerance > TOLERANCE else None
    return (
        f"{result.megabytes:.1f}",
        f"{parity.num_correct} of {result.clouds}",
        str(parity.num_correct_torch),
        f"{parity.max_difference:.1e}",
        UNDEFINED if rounding is None else f"{rounding:.1e}",
    )
