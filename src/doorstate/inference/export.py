# SPDX-License-Identifier: Apache-2.0
"""A network written as ONNX: points in metres go in, probabilities come out; checked and compared with torch."""

from __future__ import annotations

import copy
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from doorstate import __version__
from doorstate._files import atomic_path
from doorstate._jobs import Progress, no_progress
from doorstate.clouds.preparation import SCALE_M
from doorstate.errors import ExportError, missing_extra, summarize_exception
from doorstate.inference.backends.base import Outputs
from doorstate.inference.backends.onnx_backend import CARD_KEY, INPUT, OUTPUT, OnnxBackend, head_names
from doorstate.inference.backends.torch_backend import TorchBackend
from doorstate.inference.reference_clouds import LabelledClouds
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import head_outputs
from doorstate.networks.heads import HEADS, STATE
from doorstate.types import STATES, Points

if TYPE_CHECKING:
    from onnx import ModelProto

OPSET = 18  # what torch's exporter is written in; newer ones are converted from it
TOLERANCE = 1e-4  # of a probability
_PACKAGES = ("onnx", "onnxscript", "onnxruntime")  # torch's exporter asks for the second
_ANY_SIZE = 2**30  # of a constant
_JITTERS = 3
_LAST_DIGIT = np.array([-(2.0**-23), 0.0, 2.0**-23], dtype=np.float32)  # of a float32, relative
_METADATA = {
    "frame": "x forward, y left, z up, origin at the camera, gravity-aligned (ROS REP 103)",
    "units": "metres",
    "preparation": (
        "drop points that are not finite or (0, 0, 0), then keep as many as the input takes in farthest-point order; "
        f"centring and division by {SCALE_M} m are in the graph"
    ),
    "labels": ",".join(STATES),
    "heads": "; ".join(f"{head.name}: {head.description}" for head in HEADS.values()),
}


@dataclass(frozen=True)
class Comparison:
    """How far the file is from torch on the same clouds."""

    largest: float  # difference in a probability, or in what another head says
    allowed: float
    clouds: int
    right: int  # states that the file tells as they are
    right_in_torch: int


class _Graph(nn.Module):
    """Everything between sampled points in metres and probabilities."""

    def __init__(self, network: PointNetwork, card: WeightsCard) -> None:
        super().__init__()
        self.network = network
        self.temperature = card.temperature

    def forward(self, points: Tensor) -> tuple[Tensor, ...]:
        # As clouds.preparation.normalize, to the last digit: what is just inside a ball must not be just outside.
        centroid = points.mean(1, keepdim=True, dtype=torch.float64).to(torch.float32)
        outputs = head_outputs(self.network, (points - centroid) / SCALE_M, with_points=False)
        return ((outputs.pop(STATE) / self.temperature).softmax(1), *outputs.values())


def check_installed() -> None:
    """Raise MissingExtraError unless everything that an export needs is there."""
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
) -> Comparison:
    """Write a network as an ONNX file that takes any number of clouds, after a comparison with torch.

    Args:
        path: of the file, which appears only if the comparison is passed.
        network: classifier, in evaluation mode.
        card: of its weights.
        clouds: to compare on; the file will take as many points as they have.
        opset: version of ONNX's operators.
        int8: keep the matrices of linear layers as 8-bit integers; then no difference is too large.
        progress: of the comparison.

    Raises:
        MissingExtraError: onnx, onnxscript or onnxruntime is not installed.
        ExportError: the network cannot be exported, or the file answers otherwise than torch.
    """
    check_installed()
    import onnx

    num_points = clouds.points.shape[1]
    with atomic_path(path) as temporary:
        with _quiet():
            try:
                model = _model(network, card, num_points, opset)
                onnx.save(model, temporary)
                if int8:
                    _quantize(temporary)
                    model = onnx.load(temporary)
                metadata = {
                    CARD_KEY: card.model_copy(
                        update={"num_points": num_points, "default_points": None}
                    ).model_dump_json()
                }
                onnx.helper.set_model_props(model, _METADATA | metadata)
                model.producer_name, model.producer_version = "doorstate", __version__
                onnx.checker.check_model(model, full_check=True)
            except Exception as error:  # two compilers, which raise whatever they come across
                raise ExportError(
                    f"{card.network} cannot be exported with opset {opset}: {summarize_exception(error)}"
                ) from error
        onnx.save(model, temporary)
        comparison = compare_with_torch(temporary, network, card, clouds, progress)
        if not int8 and comparison.largest > comparison.allowed:
            raise ExportError(
                f"{path.name} not written: its answers differ from torch's by {comparison.largest:.1g}, "
                f"more than {comparison.allowed:.1g}"
            )
    return comparison


def compare_with_torch(
    path: Path,
    network: PointNetwork,
    card: WeightsCard,
    clouds: LabelledClouds,
    progress: Progress = no_progress,
) -> Comparison:
    """Ask the file and torch about the same clouds, alone and in pairs.

    Networks that look for neighbours among features (DGCNN) or weigh them in their order (PointCNN) turn rounding into
    another neighbour, and then torch is as far from itself. So where the difference is above `TOLERANCE`, twice what
    rounding does in torch is allowed.

    Args:
        path: a file of `export_onnx`.
        network: what it was made of.
        card: of its weights.
        clouds: with as many points as the file takes.
        progress: called after every three clouds.
    """
    points, labels = clouds
    exported, original = OnnxBackend(path), TorchBackend(network, card)
    told: list[NDArray[np.float32]] = []
    expected: list[NDArray[np.float32]] = []
    progress(0, len(points))
    for alone in range(0, len(points), 3):
        for some in (points[alone : alone + 1], points[alone + 1 : alone + 3]):
            if len(some):
                told.append(_in_columns(exported(some)))
                expected.append(_in_columns(original(some)))
        progress(min(alone + 3, len(points)), len(points))
    found, said = np.concatenate(told), np.concatenate(expected)
    largest, allowed = float(np.abs(found - said).max()), TOLERANCE
    if largest > TOLERANCE:
        allowed = max(TOLERANCE, 2 * rounding_in_torch(network, card, points))
    states = len(STATES)
    right, right_in_torch = (int((each[:, :states].argmax(1) == labels).sum()) for each in (found, said))
    return Comparison(largest, allowed, len(points), right, right_in_torch)


def _in_columns(outputs: Outputs) -> NDArray[np.float32]:
    """(B, 3 + heads) probabilities, and what heads say, angles in radians so that their digits weigh the same."""
    probabilities, columns = outputs
    heads = [np.radians(each) if name.endswith("_deg") else each for name, each in columns.items()]
    return np.column_stack([probabilities, *heads]).astype(np.float32)


def rounding_in_torch(network: PointNetwork, card: WeightsCard, points: Points) -> float:
    """How far an answer moves when the last digits change: those of the points, or all by float64."""
    original, rng = TorchBackend(network, card), np.random.default_rng(0)
    exact = TorchBackend(copy.deepcopy(network).double(), card)
    furthest = 0.0
    for cloud in points:
        said = _in_columns(original(cloud[None]))
        others = [_in_columns(exact(cloud[None]))]
        for _ in range(_JITTERS):
            jitter = np.float32(1) + rng.choice(_LAST_DIGIT, cloud.shape)
            others.append(_in_columns(original((cloud * jitter)[None])))
        furthest = max(furthest, *(float(np.abs(said - other).max()) for other in others))
    return furthest


def _model(network: PointNetwork, card: WeightsCard, num_points: int, opset: int) -> ModelProto:
    import onnxscript.optimizer

    # Not one cloud: torch.export takes a size of one for a constant.
    example = torch.linspace(-1, 1, 2 * num_points * 3).view(2, num_points, 3)
    program = torch.onnx.export(
        _Graph(network.eval(), card),
        (example,),
        dynamo=True,
        opset_version=opset,
        dynamic_shapes=({0: torch.export.Dim("batch")},),
        input_names=[INPUT],
        output_names=[OUTPUT, *head_names(card)],
        verbose=False,
    )
    assert program is not None  # since `dynamo`
    # Batch normalisation is folded into weights once, not at every start, and the quantiser finds matrices.
    model: ModelProto = onnxscript.optimizer.optimize(
        program.model_proto, input_size_limit=_ANY_SIZE, output_size_limit=_ANY_SIZE
    )
    if model.opset_import[0].version != opset:
        raise ValueError(f"it comes out with opset {model.opset_import[0].version}")
    return model


def _quantize(path: Path) -> None:
    from onnxruntime.quantization import QuantType, quantize_dynamic

    quantize_dynamic(path, path, weight_type=QuantType.QInt8)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what torch's exporter and the quantiser warn of: their own internals, and packages nobody asked for."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
