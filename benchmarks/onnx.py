# SPDX-License-Identifier: Apache-2.0
"""What exported files say beside torch, in float32 and with matrices of 8-bit integers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.store import Group
from doorstate._jobs import Progress
from doorstate.errors import ExportError
from doorstate.evaluation.table import UNDEFINED, Table
from doorstate.inference.export import TOLERANCE, export_onnx
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks.weights import load_weights

FORMS = ("onnxruntime", "onnxruntime int8")


def measure(weights: Path, clouds: LabelledClouds, progress: Progress) -> list[Group]:
    """One row for each form of a network's weights, both compared with torch on the same clouds."""
    network, card = load_weights(weights)
    rows: list[Group] = []
    with TemporaryDirectory() as folder:
        for form in FORMS:
            path = Path(folder) / f"{card.network}.onnx"
            row: Group = {"network": card.network, "form": form, "clouds": len(clouds.points)}
            try:
                parity = export_onnx(path, network, card, clouds, int8="int8" in form, progress=progress)
            except ExportError as error:
                rows.append(row | {"reason": str(error)})
                continue
            rows.append(
                row
                | {
                    "megabytes": path.stat().st_size / 1e6,
                    "right": parity.num_correct,
                    "right_in_torch": parity.num_correct_torch,
                    "largest": parity.max_difference,
                    "rounding_in_torch": parity.tolerance / 2 if parity.tolerance > TOLERANCE else None,
                }
            )
    return rows


def onnx_table(rows: Sequence[Group]) -> Table:
    """One line per network and form."""
    return Table(
        "Exported networks beside torch",
        ("network", "runtime", "MB", "states right", "by torch", "largest difference", "rounding in torch"),
        tuple((row["network"], row["form"], *_cells(row)) for row in rows),
        "Differences are of a probability, on simulated doors of no data set. Where one is above "
        f"{TOLERANCE:.0e}, the last column says how far torch's own answers move when the last digits of the points "
        "change, or all is computed in float64.",
        text_columns=2,
    )


def _cells(row: Group) -> tuple[str, ...]:
    if "reason" in row:
        return ("not written", *[UNDEFINED] * 4)
    rounding = row["rounding_in_torch"]
    return (
        f"{row['megabytes']:.1f}",
        f"{row['right']} of {row['clouds']}",
        str(row["right_in_torch"]),
        f"{row['largest']:.1e}",
        UNDEFINED if rounding is None else f"{rounding:.1e}",
    )
