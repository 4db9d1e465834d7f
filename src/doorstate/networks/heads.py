# SPDX-License-Identifier: Apache-2.0
"""What a network says of a door besides its state: one small class per answer, on features that all of them share.

A network without heads is the paper's. Answers are in the network's own units and axes (clouds.preparation.normalize);
what is not known of a cloud is NaN in its target, and costs nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from doorstate.errors import unknown_name
from doorstate.networks.base import Neighbourhoods, PointNetwork
from doorstate.networks.kernels.ops import at_least_float32, full_precision
from doorstate.networks.layers import Dense, glorot
from doorstate.types import PARTS, Part

Targets = Mapping[str, Tensor]
"""By head's name: (B, `answers`) float targets, NaN where unknown."""


class Head(nn.Module, ABC):
    """One answer per cloud: a hidden layer, then as many numbers as the answer has."""

    outputs: int
    """Numbers before `decode`."""
    answers: int
    """Numbers after it, and in a target."""

    def __init__(self, feature_size: int) -> None:
        super().__init__()
        self.hidden = Dense(feature_size, 128)
        self.linear = glorot(nn.Linear(128, self.outputs))

    def forward(self, features: Tensor) -> Tensor:
        """(B, outputs) of (B, F) features."""
        rows: Tensor = at_least_float32(self.hidden(features))
        with full_precision(rows):
            out: Tensor = self.linear(rows)
        return out

    @abstractmethod
    def decode(self, outputs: Tensor) -> Tensor:
        """(B, answers), in the units of the targets, of (B, outputs)."""

    @abstractmethod
    def losses(self, outputs: Tensor, target: Tensor) -> Tensor:
        """(B,) losses of (B, outputs) against (B, answers) without NaN."""


class YesNo(Head):
    """A probability; the target is 0 or 1."""

    outputs, answers = 1, 1

    def decode(self, outputs: Tensor) -> Tensor:
        return outputs.sigmoid()

    def losses(self, outputs: Tensor, target: Tensor) -> Tensor:
        return functional.binary_cross_entropy_with_logits(outputs, target, reduction="none").squeeze(1)


class DoorPresence(YesNo):
    """Probability that there is a door. What the network's own head says is of a door."""


class OpeningAngle(Head):
    """Opening angle in radians, as a direction in the plane, so that no angle is far from its neighbour."""

    outputs, answers = 2, 1

    def decode(self, outputs: Tensor) -> Tensor:
        return torch.atan2(outputs[:, 1], outputs[:, 0]).unsqueeze(1)

    def losses(self, outputs: Tensor, target: Tensor) -> Tensor:
        direction = torch.cat([target.cos(), target.sin()], dim=1)
        return _distance(outputs, direction)


class HingeSide(YesNo):
    """Probability that the hinge is on the left, as seen from the camera."""


class FramePose(Head):
    """Middle of the door frame x, y and the yaw of its outward normal in radians."""

    outputs, answers = 4, 3

    def decode(self, outputs: Tensor) -> Tensor:
        return torch.cat([outputs[:, :2], torch.atan2(outputs[:, 3:], outputs[:, 2:3])], dim=1)

    def losses(self, outputs: Tensor, target: Tensor) -> Tensor:
        direction = torch.cat([target[:, 2:].cos(), target[:, 2:].sin()], dim=1)
        return _POSITION * _distance(outputs[:, :2], target[:, :2]) + _distance(outputs[:, 2:], direction)


class Widths(Head):
    """Width of the opening, and of what can be passed between leaf and jamb."""

    outputs, answers = 2, 2

    def decode(self, outputs: Tensor) -> Tensor:
        return outputs.clamp_min(0)

    def losses(self, outputs: Tensor, target: Tensor) -> Tensor:
        return _POSITION * (outputs - target).abs().sum(dim=1)


_POSITION = 3.0  # per unit of the normalised cloud: losses of lengths are in metres, next to those of angles in radians


HEADS: dict[str, type[Head]] = {
    "door": DoorPresence,
    "angle": OpeningAngle,
    "hinge": HingeSide,
    "frame": FramePose,
    "widths": Widths,
}
STATE = "state"
"""Name of what the network's own head says."""


def add_heads(network: PointNetwork, names: Sequence[str], num_parts: int = len(Part) - 1) -> None:
    """Add heads to a network; what it had stays as it is.

    Args:
        network: any.
        names: of `HEADS`, or "parts".
        num_parts: classes of the points.

    Raises:
        ConfigError: unknown head, or parts of a network without a per-point branch.
    """
    for name in names:
        if name == PARTS:
            network.heads[name] = network.part_branch(num_parts)
        elif name in HEADS:
            network.heads[name] = HEADS[name](network.feature_size)
        else:
            raise unknown_name("head", name, [*HEADS, PARTS])


def answers(
    network: PointNetwork,
    points: Tensor,
    neighbourhoods: Neighbourhoods | None = None,
    *,
    parts: bool = True,
) -> dict[str, Tensor]:
    """Logits of the states (B, num_classes) under "state", of the parts (B, N, num_parts), and (B, answers) by head.

    Args:
        network: with heads or without.
        points: (B, N, 3) as in `PointNetwork.forward`.
        neighbourhoods: as there.
        parts: of the points too, if the network has that head.

    Raises:
        CloudContentError: as there.
    """
    network.check(points)
    encoding = network.encode(points, neighbourhoods)
    found = {STATE: at_least_float32(network.head(encoding.features))}
    for name, head in network.heads.items():
        if isinstance(head, Head):
            found[name] = head.decode(head(encoding.features))
        elif parts:
            found[name] = at_least_float32(head(points, encoding))
    return found


def joint_losses(
    network: PointNetwork,
    points: Tensor,
    labels: Tensor,
    targets: Targets,
    label_smoothing: float = 0.0,
    neighbourhoods: Neighbourhoods | None = None,
    part_points: int | None = None,
) -> tuple[dict[str, Tensor], Tensor]:
    """Scalar losses by head, "state" among them, each the mean over the clouds that know its target.

    Args:
        network: with heads.
        points: (B, N, 3) as in `PointNetwork.forward`.
        labels: (B,) int64 states, -100 where there is no door.
        targets: by head; "parts" (B, N) int64, negative where unknown.
        label_smoothing: of the state.
        neighbourhoods: as in `PointNetwork.forward`.
        part_points: so many of each cloud, the first, which lie all over it, is what parts are learned on; all if None.

    Returns:
        Losses, and (B, num_classes) logits of the states.
    """
    network.check(points)
    encoding = network.encode(points, neighbourhoods)
    loss, logits = network.loss_of(encoding, labels, label_smoothing)
    # A mean over no doors at all is no number.
    losses = {STATE: loss if (labels >= 0).any() else logits.sum() * 0}
    for name, head in network.heads.items():
        target = targets[name]
        if not isinstance(head, Head):
            some = slice(part_points)
            losses[name] = _part_loss(at_least_float32(head(points[:, some], encoding)), target[:, some])
            continue
        # The hidden layer normalises over the batch: all clouds go through it, known or not.
        outputs = head(encoding.features)
        known = ~target.isnan().any(dim=1)
        each = head.losses(outputs, target.nan_to_num())
        losses[name] = (each * known).sum() / known.sum().clamp_min(1)
    return losses, logits


def _part_loss(logits: Tensor, parts: Tensor) -> Tensor:
    known = parts >= 0
    each = functional.cross_entropy(logits.flatten(0, 1), parts.clamp_min(0).flatten(), reduction="none")
    loss: Tensor = (each * known.flatten()).sum() / known.sum().clamp_min(1)
    return loss


def _distance(outputs: Tensor, target: Tensor) -> Tensor:
    """(B,) Euclidean distance; not its square, which one wrong side of a symmetric door would dominate."""
    distance: Tensor = torch.linalg.vector_norm(outputs - target, dim=1)
    return distance
