# SPDX-License-Identifier: Apache-2.0
"""Layers of the heads, and a network's outputs and losses with them. A network without heads is the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from doorstate.errors import unknown_name
from doorstate.networks.base import Neighbourhoods, PointNetwork
from doorstate.networks.heads import HEADS, POINT_HEADS, STATE, HeadSpec
from doorstate.networks.kernels.precision import at_least_float32, full_precision
from doorstate.networks.layers.dense import Dense, glorot

Targets = Mapping[str, Tensor]
"""By name of the head: (B, num_values) float targets, NaN where unknown; or (B, n) int64 classes of points."""

_HIDDEN = 128


class Head(nn.Module):
    """One hidden layer on the cloud's features, then as many numbers as the head has outputs."""

    def __init__(self, spec: HeadSpec, feature_size: int) -> None:
        super().__init__()
        self.spec = spec
        self.hidden = Dense(feature_size, _HIDDEN)
        self.linear = glorot(nn.Linear(_HIDDEN, spec.num_outputs))

    def forward(self, features: Tensor) -> Tensor:
        """Return (B, num_outputs) outputs of (B, F) features."""
        rows: Tensor = at_least_float32(self.hidden(features))
        with full_precision(rows):
            outputs: Tensor = self.linear(rows)
        return outputs


def add_heads(network: PointNetwork, names: Sequence[str]) -> None:
    """Add untrained heads to a network; its own layers are unchanged.

    Args:
        network: any network.
        names: names in `HEADS` or `POINT_HEADS`.

    Raises:
        ConfigError: unknown head, or a head for points on a network without a per-point branch.
    """
    for name in names:
        if name in POINT_HEADS:
            network.heads[name] = network.part_branch(len(POINT_HEADS[name].classes))
        elif name in HEADS:
            network.heads[name] = Head(HEADS[name], network.feature_size)
        else:
            raise unknown_name("head", name, [*HEADS, *POINT_HEADS])


def head_outputs(
    network: PointNetwork,
    points: Tensor,
    neighbourhoods: Neighbourhoods | None = None,
    *,
    with_points: bool = True,
) -> dict[str, Tensor]:
    """Run a network with all its heads.

    Args:
        network: any network.
        points: (B, N, 3) as in `PointNetwork.forward`.
        neighbourhoods: as in `PointNetwork.forward`.
        with_points: run the heads that classify points, too.

    Returns:
        (B, num_classes) logits under "state", (B, num_values) decoded values by name of the head, and (B, N, C) logits
        of the heads that classify points.

    Raises:
        CloudContentError: as in `PointNetwork.forward`.
    """
    network.check_points(points)
    encoding = network.encode(points, neighbourhoods)
    outputs = {STATE: at_least_float32(network.head(encoding.features))}
    for name, head in network.heads.items():
        if isinstance(head, Head):
            outputs[name] = head.spec.decode(head(encoding.features))
        elif with_points:
            outputs[name] = at_least_float32(head(points, encoding))
    return outputs


def joint_losses(
    network: PointNetwork,
    points: Tensor,
    labels: Tensor,
    targets: Targets,
    label_smoothing: float = 0.0,
    neighbourhoods: Neighbourhoods | None = None,
    part_points: int | None = None,
) -> tuple[dict[str, Tensor], Tensor]:
    """Compute the loss of every head.

    Args:
        network: any network.
        points: (B, N, 3) as in `PointNetwork.forward`.
        labels: (B,) int64 states, -100 for none.
        targets: targets by head.
        label_smoothing: as in `PointNetwork.training_loss`, for the state.
        neighbourhoods: as in `PointNetwork.forward`.
        part_points: number of points per cloud, the first ones, on which heads for points are trained; None takes all.

    Returns:
        Scalar losses by name of the head, "state" among them, each the mean over the clouds with a target; and
        (B, num_classes) logits of the states.
    """
    network.check_points(points)
    encoding = network.encode(points, neighbourhoods)
    # The mean over no states would be NaN. Without a branch, because a branch would wait for the device.
    has_state = (labels >= 0).any()
    loss, logits = network.loss_from_encoding(
        encoding, labels.where(has_state, torch.zeros_like(labels)), label_smoothing
    )
    losses = {STATE: loss * has_state}
    for name, head in network.heads.items():
        target = targets[name]
        if isinstance(head, Head):
            # The hidden layer normalises over the batch, so clouds without a target pass through it as well.
            outputs = head(encoding.features)
            has_target = ~target.isnan().any(dim=1)
            per_cloud = head.spec.loss(outputs, target.nan_to_num())
            losses[name] = (per_cloud * has_target).sum() / has_target.sum().clamp_min(1)
        else:
            first = slice(part_points)
            point_logits = at_least_float32(head(points[:, first], encoding))
            losses[name] = POINT_HEADS[name].loss(point_logits, target[:, first])
    return losses, logits
