# SPDX-License-Identifier: Apache-2.0
"""ONNX graph of a network, from sampled points in metres to a state or the reason for a refusal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from doorstate.inference.backends.onnx_backend import (
    INPUT,
    PROBABILITIES,
    RAW_PROBABILITIES,
    REASON,
    head_names,
)
from doorstate.inference.export.refusals import REFUSED, Refusals
from doorstate.inference.gate import Gate
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import head_outputs
from doorstate.networks.heads import STATE
from doorstate.types import DOOR

if TYPE_CHECKING:
    from onnx import ModelProto

_EXAMPLE_POINTS = 700
_NO_SIZE_LIMIT = 2**30  # of a constant that the optimizer may fold


class _MetresToProbabilities(nn.Module):
    """Normalisation, network, temperature and softmax."""

    def __init__(self, network: PointNetwork, card: WeightsCard) -> None:
        super().__init__()
        self.network = network
        self.temperature = card.temperature
        self.scale_m = card.normalization.scale_m
        self.centre_m = card.normalization.centre_m

    def forward(self, points: Tensor) -> tuple[Tensor, ...]:
        # Bit for bit as clouds.normalization: a point just inside a ball must not be just outside.
        if self.centre_m is None:
            centre = points.mean(1, keepdim=True, dtype=torch.float64).to(torch.float32)
        else:
            centre = torch.tensor(self.centre_m, dtype=torch.float32)
        outputs = head_outputs(self.network, (points - centre) / self.scale_m, with_points=False)
        return ((outputs.pop(STATE) / self.temperature).softmax(1), *outputs.values())


class _MetresToState(nn.Module):
    """Network whose outputs are given only where its state is."""

    def __init__(self, network: nn.Module, card: WeightsCard, refusals: Refusals) -> None:
        super().__init__()
        self.network = network
        self.heads = head_names(card)
        self.refusals = refusals

    def forward(self, points: Tensor) -> tuple[Tensor, ...]:
        raw, *values = self.network(points)
        heads = dict(zip(self.heads, values, strict=True))
        reason = self.refusals(points, raw, heads)
        has_state = reason == 0
        state = torch.where(has_state, raw.argmax(1), REFUSED)
        # Zeros and not NaN, which would stay for ever in what a program averages over time.
        probabilities = torch.where(has_state[:, None], raw, 0.0)
        given = (
            output if name == DOOR else torch.where(has_state[:, None], output, torch.nan)
            for name, output in heads.items()
        )
        return state, reason, probabilities, raw, *given


def build_graph(
    network: PointNetwork, card: WeightsCard, num_points: int, opset: int, gate: Gate | None
) -> ModelProto:
    """Return the optimized graph of a network that takes any number of clouds of `num_points`.

    Raises:
        ValueError: the exporter cannot write this opset. Its own errors are of any type.
    """
    # Folds batch normalisation into weights once instead of at every start, and the quantizer finds matrices.
    return fold_constants(trace(network, card, num_points, opset, Refusals(card, gate)))


def trace(
    network: PointNetwork,
    card: WeightsCard,
    num_points: int | None,
    opset: int,
    refusals: Refusals | None = None,
) -> ModelProto:
    """Return the graph as torch writes it, with every tensor of the network in its initializers.

    Args:
        network: classifier.
        card: card of its weights.
        num_points: points per cloud; None: any number from the network's `min_points`.
        opset: version of ONNX's operators.
        refusals: refusals in the graph; None for the network alone.

    Raises:
        ValueError: the exporter cannot write this opset. Its own errors are of any type.
    """
    module: nn.Module = _MetresToProbabilities(network.eval(), card)
    outputs = [PROBABILITIES, *head_names(card)]
    if refusals is not None:
        module = _MetresToState(module, card, refusals)
        outputs = [STATE, REASON, PROBABILITIES, RAW_PROBABILITIES, *head_names(card)]
    # Two clouds, because torch.export takes a size of one for a constant; more points than any network has centres.
    example = torch.linspace(-1, 1, 2 * (num_points or _EXAMPLE_POINTS) * 3).view(2, -1, 3)
    sizes: dict[int, object] = {0: torch.export.Dim("batch")}
    if num_points is None:
        sizes[1] = torch.export.Dim(INPUT, min=network.min_points)
    with torch.no_grad():
        program = torch.export.export(
            module,
            (example,),
            dynamic_shapes=(sizes,),
            # Sizes are compared to see how torch lays out memory, which a graph does not know.
            prefer_deferred_runtime_asserts_over_guards=True,
        )
        exported = torch.onnx.export(
            program,
            dynamo=True,
            opset_version=opset,
            input_names=[INPUT],
            output_names=outputs,
            optimize=False,
            verbose=False,
        )
    assert exported is not None  # with `dynamo`
    model: ModelProto = exported.model_proto
    if model.opset_import[0].version != opset:
        raise ValueError(f"the exporter writes opset {model.opset_import[0].version}")
    return model


def fold_constants(model: ModelProto) -> ModelProto:
    """Return the graph with everything computed that depends on initializers and constants alone."""
    import onnxscript.optimizer

    folded: ModelProto = onnxscript.optimizer.optimize(
        model, input_size_limit=_NO_SIZE_LIMIT, output_size_limit=_NO_SIZE_LIMIT
    )
    return folded
