# SPDX-License-Identifier: Apache-2.0
"""Batches of normalised clouds; what an epoch draws depends on its seed alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from doorstate.clouds.augment import Augmentation, apply_augmentation, draw_augmentation
from doorstate.clouds.preparation import normalize
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError


class Batch(NamedTuple):
    """(B, n, 3) float32 normalised points and (B,) int64 labels."""

    points: Tensor
    labels: Tensor


class CloudLoader:
    """The first `num_points` of chosen samples, normalised once and kept in memory."""

    def __init__(self, dataset: PreparedDataset, sample_ids: Sequence[str], num_points: int) -> None:
        """Load clouds.

        Raises:
            ConfigError: more points are asked for than the data set holds.
        """
        if num_points > dataset.num_points:
            raise ConfigError(
                f"{dataset.folder}: holds {dataset.num_points} points a cloud, not {num_points}"
            )
        indices = np.array([dataset.index_of(sample) for sample in sample_ids], dtype=np.int64)
        self.sample_ids = list(sample_ids)
        # A prefix of a farthest-point order is the farthest-point sample of that size.
        self._points = normalize(dataset.clouds[indices, :num_points])
        self._labels = dataset.labels[indices]

    def __len__(self) -> int:
        return len(self._labels)

    def in_order(self, batch_size: int) -> Iterator[Batch]:
        """Every sample once, in order, unchanged."""
        for start in range(0, len(self), batch_size):
            yield self._batch(np.arange(start, min(start + batch_size, len(self))), None, None)

    def shuffled(self, batch_size: int, augmentation: Augmentation, seed: Sequence[int]) -> Iterator[Batch]:
        """One training epoch: shuffled, augmented, an incomplete last batch left out."""
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(self))
        batch_size = min(batch_size, len(self))
        for start in range(0, len(self) - batch_size + 1, batch_size):
            yield self._batch(order[start : start + batch_size], augmentation, rng)

    def _batch(
        self, chosen: np.ndarray, augmentation: Augmentation | None, rng: np.random.Generator | None
    ) -> Batch:
        points = self._points[chosen]
        if augmentation is not None and rng is not None:
            points = apply_augmentation(points, draw_augmentation(augmentation, rng, *points.shape[:2]))
        return Batch(torch.from_numpy(points), torch.from_numpy(self._labels[chosen]))
