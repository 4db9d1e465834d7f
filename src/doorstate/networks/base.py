# SPDX-License-Identifier: Apache-2.0
"""What every network offers: logits, the features before its head, and its own training loss."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from torch import Tensor, nn
from torch.nn import functional

from doorstate.errors import CloudContentError, ConfigError
from doorstate.networks.kernels.ops import at_least_float32

Neighbourhoods = tuple[Tensor, ...]
"""Indices (B, ...) into a cloud's points that depend on coordinates alone."""


class Encoding(NamedTuple):
    """What a network makes of a batch of clouds before any head looks at it."""

    features: Tensor
    """(B, F) of the whole clouds."""
    inner: tuple[Tensor, ...] = ()
    """What the network's own loss or its per-point branch needs besides; each network says what."""


class PointNetwork(nn.Module, ABC):
    """Classifier of point clouds stored in farthest-point order.

    Deviation: no network samples centres. Points arrive in farthest-point order, so the first M of them
    are what farthest point sampling from point 0 would choose; representative points are prefixes too.
    """

    min_points: int = 128
    """Fewest points per cloud."""
    neighbours_keep_under_scale: bool = True
    """Whether `neighbourhoods` of a cloud stay the same when it is scaled; they always do when it is turned."""
    has_point_features: bool = False
    """Whether the network has a per-point branch (`part_branch`)."""
    feature_size: int
    """Channels of `features`."""
    head: nn.Module
    """From features to logits."""

    def __init__(self) -> None:
        super().__init__()
        self.heads = nn.ModuleDict()
        """Further answers by name (networks.heads); none in the paper's networks."""

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Neighbours that the network looks for among the coordinates, so that they can be kept for the next epoch.

        Args:
            points: (B, N, 3) as in `forward`.

        Returns:
            (B, ...) int64 indices, as `forward` and `training_loss` take them.
        """
        return ()

    def use_centres(self, share: float) -> None:
        """Look at the first `share` (0 to 1) of the centres from now on, for a coarser training; 1 is all of them.

        Nothing changes in a network without a fixed number of centres.
        """
        return

    @abstractmethod
    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Everything before the heads, of (B, N, 3) points."""

    def features(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Tensor:
        """(B, F) global features of (B, N, 3) points."""
        return self.encode(points, neighbourhoods).features

    def part_branch(self, num_parts: int) -> nn.Module:
        """A module from (points, encoding) to (B, N, num_parts) logits of every point's part.

        Raises:
            ConfigError: the network has no features of single points.
        """
        raise ConfigError(f"{type(self).__name__} has no per-point branch: leave out the head 'parts'")

    def forward(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Tensor:
        """Classify clouds.

        Args:
            points: (B, N, 3) centred coordinates in farthest-point order, N >= `min_points`.
            neighbourhoods: of these points, if they are known; otherwise they are looked for.

        Returns:
            (B, num_classes) logits, float32 also under autocast.

        Raises:
            CloudContentError: The points have another shape, or there are too few.
        """
        self.check(points)
        return at_least_float32(self.head(self.features(points, neighbourhoods)))

    def training_loss(
        self,
        points: Tensor,
        labels: Tensor,
        label_smoothing: float = 0.0,
        neighbourhoods: Neighbourhoods | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Loss the network is trained with.

        Args:
            points: (B, N, 3) as in `forward`.
            labels: (B,) int64 classes; -100 is passed over.
            label_smoothing: eps of 1 - eps + eps/C for the true class and eps/C for each other of C classes.
                (The 1 - eps and eps/(C - 1) of DGCNN's authors is the same with eps * C/(C - 1).)
            neighbourhoods: as in `forward`.

        Returns:
            Scalar loss and (B, num_classes) logits.
        """
        self.check(points)
        return self.loss_of(self.encode(points, neighbourhoods), labels, label_smoothing)

    def loss_of(self, encoding: Encoding, labels: Tensor, label_smoothing: float) -> tuple[Tensor, Tensor]:
        """As `training_loss`, of clouds that are encoded."""
        logits = at_least_float32(self.head(encoding.features))
        return functional.cross_entropy(logits, labels, label_smoothing=label_smoothing), logits

    def check(self, points: Tensor) -> None:
        """Raise CloudContentError unless points are (B, N, 3) with enough points."""
        if points.dim() != 3 or points.shape[-1] != 3 or points.shape[1] < self.min_points:
            raise CloudContentError(
                f"points have shape {tuple(points.shape)}: "
                f"pass (batch, points, 3) with at least {self.min_points} points"
            )
