# SPDX-License-Identifier: Apache-2.0
"""Interface of all networks: logits, features before the head, and the network's own training loss."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from torch import Tensor, nn
from torch.nn import functional

from doorstate.errors import CloudContentError, ConfigError
from doorstate.networks.kernels.precision import at_least_float32

Neighbourhoods = tuple[Tensor, ...]
"""(B, ...) int64 indices into the points of each cloud, which depend on coordinates alone."""


class Encoding(NamedTuple):
    """Features of a batch of clouds before any head."""

    features: Tensor
    """(B, F) features of whole clouds."""
    intermediate: tuple[Tensor, ...] = ()
    """Tensors that the network's own loss or its per-point branch needs; described by its `encode`."""


class PointNetwork(nn.Module, ABC):
    """Classifier of point clouds in farthest-point order.

    Deviation: no network samples centres. The first M points of a cloud in farthest-point order are those that farthest
    point sampling from point 0 would choose; representative points are prefixes, too.
    """

    min_points: int = 128
    """Smallest number of points per cloud."""
    neighbours_are_scale_invariant: bool = True
    """Scaling a cloud keeps its `neighbourhoods`; turning always does."""
    has_point_features: bool = False
    """The network has a per-point branch (`part_branch`)."""
    feature_size: int
    """Channels of `features`."""
    head: nn.Module
    """From features to logits."""
    num_ranks = 1
    """Number of processes that share each batch of the training."""

    def __init__(self) -> None:
        super().__init__()
        self.heads = nn.ModuleDict()
        """Further heads by name (networks.heads); none in the paper's networks."""

    def neighbourhoods(self, points: Tensor) -> Neighbourhoods:
        """Search the neighbours that depend on coordinates alone, so that they can be kept for the next epoch.

        Args:
            points: (B, N, 3) as in `forward`.

        Returns:
            (B, ...) int64 indices, as `forward` and `training_loss` take them.
        """
        return ()

    def use_centres(self, share: float) -> None:
        """Use only the first `share` (0 to 1) of the centres from now on, for coarse training.

        Networks without a fixed number of centres do not change.
        """
        return

    def use_ranks(self, count: int) -> None:
        """Train with the statistics of batches that `count` processes of torch.distributed share equally.

        The mean of the ranks' losses, and of their gradients, is then that of the whole batch.
        """
        for module in self.modules():
            if hasattr(module, "num_ranks"):
                module.num_ranks = count  # type: ignore[assignment]

    @abstractmethod
    def encode(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Encoding:
        """Compute everything before the heads, of (B, N, 3) points."""

    def features(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Tensor:
        """Return the (B, F) features of (B, N, 3) points."""
        return self.encode(points, neighbourhoods).features

    def part_branch(self, num_parts: int) -> nn.Module:
        """Build an untrained module from (points, encoding) to (B, N, num_parts) logits of every point.

        Raises:
            ConfigError: the network has no features of single points.
        """
        raise ConfigError(f"{type(self).__name__} has no per-point branch", hint="leave out the head 'parts'")

    def forward(self, points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Tensor:
        """Classify clouds.

        Args:
            points: (B, N, 3) centred coordinates in farthest-point order, N >= `min_points`.
            neighbourhoods: result of `neighbourhoods` for these points; None searches them.

        Returns:
            (B, num_classes) logits, float32 also under autocast.

        Raises:
            CloudContentError: the points have another shape, or there are too few.
        """
        self.check_points(points)
        return at_least_float32(self.head(self.features(points, neighbourhoods)))

    def training_loss(
        self,
        points: Tensor,
        labels: Tensor,
        label_smoothing: float = 0.0,
        neighbourhoods: Neighbourhoods | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Compute the loss that the network is trained with.

        Args:
            points: (B, N, 3) as in `forward`.
            labels: (B,) int64 classes; -100 is skipped.
            label_smoothing: eps of 1 - eps + eps/C for the true class and eps/C for each other of C classes.
                (The 1 - eps and eps/(C - 1) of DGCNN's authors is the same with eps * C/(C - 1).)
            neighbourhoods: as in `forward`.

        Returns:
            Scalar loss and (B, num_classes) logits.
        """
        self.check_points(points)
        return self.loss_from_encoding(self.encode(points, neighbourhoods), labels, label_smoothing)

    def loss_from_encoding(
        self, encoding: Encoding, labels: Tensor, label_smoothing: float
    ) -> tuple[Tensor, Tensor]:
        """Compute `training_loss` of encoded clouds."""
        logits = at_least_float32(self.head(encoding.features))
        return functional.cross_entropy(logits, labels, label_smoothing=label_smoothing), logits

    def check_points(self, points: Tensor) -> None:
        """Raise CloudContentError unless points are (B, N, 3) with enough points."""
        if points.dim() != 3 or points.shape[-1] != 3 or points.shape[1] < self.min_points:
            raise CloudContentError(
                f"points have shape {tuple(points.shape)}",
                expected=f"(batch, points, 3) with at least {self.min_points} points",
            )
