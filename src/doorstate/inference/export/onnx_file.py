# SPDX-License-Identifier: Apache-2.0
"""ONNX file of a network, with the description of its input and outputs and the weights card."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from doorstate._files import atomic_path
from doorstate._jobs import Progress, no_progress
from doorstate.errors import ExportError, summarize_exception
from doorstate.inference.export.description import describe
from doorstate.inference.export.graph import build_graph
from doorstate.inference.export.outputs import describe_refusals
from doorstate.inference.export.packages import OPSET, check_export_packages, without_warnings
from doorstate.inference.export.parity import Parity, compare_with_torch
from doorstate.inference.gate import DEFAULT_GATE, Gate
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.digest import add_digest

if TYPE_CHECKING:
    from onnx import ModelProto


def export_onnx(
    path: Path,
    network: PointNetwork,
    card: WeightsCard,
    clouds: LabelledClouds,
    *,
    opset: int = OPSET,
    int8: bool = False,
    gate: Gate | None = DEFAULT_GATE,
    progress: Progress = no_progress,
) -> Parity:
    """Write a network as an ONNX file that takes any number of clouds, after a comparison with torch.

    Args:
        path: file to write; it appears only if the comparison passes.
        network: classifier.
        card: card of its weights.
        clouds: clouds for the comparison; the file takes as many points as they have.
        opset: version of ONNX's operators.
        int8: store the matrices of linear layers as 8-bit integers; then any difference is accepted.
        gate: limits of the sampled points in the graph, and of the raw cloud in the metadata; None for none.
        progress: called with clouds compared and clouds in all.

    Raises:
        MissingExtraError: onnx, onnxscript or onnxruntime is not installed.
        ExportError: the network cannot be exported, or the file differs from torch.
    """
    check_export_packages()
    import onnx

    num_points = clouds.points.shape[1]
    with atomic_path(path) as temporary:
        try:
            with without_warnings():
                model = build_graph(network, card, num_points, opset, gate)
                if int8:
                    model = _quantize_linear_layers(model, temporary)
                describe(
                    model,
                    card.model_copy(update={"num_points": num_points, "default_points": None}),
                    describe_refusals(card, gate),
                )
                onnx.checker.check_model(model, full_check=True)
        except Exception as error:  # the exporter and the quantizer raise errors of any type
            raise ExportError(
                f"{card.network} cannot be exported with opset {opset}: {summarize_exception(error)}"
            ) from error
        temporary.write_bytes(add_digest(model.SerializeToString()))
        parity = compare_with_torch(temporary, network, card, clouds, progress)
        if not (int8 or parity.max_difference <= parity.tolerance):
            raise ExportError(
                f"not written: its outputs differ from torch's by {parity.max_difference:.1g}, "
                f"more than {parity.tolerance:.1g}",
                path=path,
            )
    return parity


def _quantize_linear_layers(model: ModelProto, path: Path) -> ModelProto:
    """Return the graph with the matrices of linear layers as 8-bit integers.

    Args:
        model: float32 graph.
        path: file to work in, because the quantizer reads and writes files.
    """
    import onnx
    from onnxruntime.quantization import QuantType, quantize_dynamic

    onnx.save(model, path)
    quantize_dynamic(path, path, weight_type=QuantType.QInt8)
    return onnx.load(path)
