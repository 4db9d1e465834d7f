# SPDX-License-Identifier: Apache-2.0
"""ONNX file of a network, with the description of its input and outputs and the weights card."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from doorstate import __version__
from doorstate._files import atomic_path
from doorstate._jobs import Progress, no_progress
from doorstate.clouds.normalization import SCALE_M
from doorstate.errors import ExportError, missing_extra, summarize_exception
from doorstate.inference.export.graph import build_graph
from doorstate.inference.export.parity import Parity, compare_with_torch
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.heads import HEADS
from doorstate.types import STATES

if TYPE_CHECKING:
    from onnx import ModelProto

OPSET = 18  # torch's exporter writes it; newer ones are converted from it
_PACKAGES = ("onnx", "onnxscript", "onnxruntime")  # torch's exporter needs the second
_DESCRIPTION = {
    "frame": "x forward, y left, z up, origin at the camera, gravity-aligned (ROS REP 103)",
    "units": "metres",
    "preparation": (
        "drop points that are not finite or (0, 0, 0), then keep as many as the input takes in farthest-point order; "
        f"centring and division by {SCALE_M} m are in the graph"
    ),
    "labels": ",".join(STATES),
    "heads": "; ".join(f"{head.name}: {head.description}" for head in HEADS.values()),
}


def check_export_packages() -> None:
    """Check that the packages for an export are installed.

    Raises:
        MissingExtraError: one of them is not.
    """
    try:
        for package in _PACKAGES:
            import_module(package)
    except ImportError as error:
        raise missing_extra("export", *_PACKAGES) from error


def export_onnx(
    path: Path,
    network: PointNetwork,
    card: WeightsCard,
    clouds: LabelledClouds,
    *,
    opset: int = OPSET,
    int8: bool = False,
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
            with _without_warnings():
                model = build_graph(network, card, num_points, opset)
                if int8:
                    model = _quantize_linear_layers(model, temporary)
                _describe(model, card, num_points)
                onnx.checker.check_model(model, full_check=True)
        except Exception as error:  # the exporter and the quantizer raise errors of any type
            raise ExportError(
                f"{card.network} cannot be exported with opset {opset}: {summarize_exception(error)}"
            ) from error
        onnx.save(model, temporary)
        parity = compare_with_torch(temporary, network, card, clouds, progress)
        if not int8 and parity.max_difference > parity.tolerance:
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


def _describe(model: ModelProto, card: WeightsCard, num_points: int) -> None:
    import onnx

    exported = card.model_copy(update={"num_points": num_points, "default_points": None})
    onnx.helper.set_model_props(model, _DESCRIPTION | {CARD_KEY: exported.model_dump_json()})
    model.producer_name, model.producer_version = "doorstate", __version__


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Suppress warnings of torch's exporter and of the quantizer about their own internals and optional packages."""
    previous = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(previous)
