# SPDX-License-Identifier: Apache-2.0
"""Batches of normalised clouds; what an epoch draws depends on its seed alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from doorstate.clouds.augmentation import (
    Augmentation,
    AugmentationDraw,
    apply_augmentation,
    draw_augmentation,
)
from doorstate.clouds.normalization import centroids, normalize
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError
from doorstate.networks.heads import IGNORE_INDEX, POINT_HEADS, augment_targets, head_targets
from doorstate.types import DOOR, PARTS, DoorState

FindNeighbours = Callable[[Tensor], tuple[Tensor, ...]]
"""From (B, n, 3) points to (B, ...) int64 indices into them."""


class Batch(NamedTuple):
    """(B, n, 3) float32 normalised points, (B,) int64 labels, what the loader's search found, and targets by head."""

    points: Tensor
    labels: Tensor
    neighbourhoods: tuple[Tensor, ...] | None = None
    targets: Mapping[str, Tensor] = MappingProxyType({})


def check_states(dataset: PreparedDataset, sample_ids: Sequence[str], heads: Sequence[str]) -> None:
    """Raise ConfigError if samples show no door and there is no head that could say so."""
    if DOOR in heads:
        return
    without = [sample for sample in sample_ids if dataset.labels[dataset.index_of(sample)] >= len(DoorState)]
    if without:
        raise ConfigError(
            f"{dataset.folder}: {len(without)} samples show no door, such as {without[0]}; "
            f"a network of three states learns nothing from them: leave them out, or add the head '{DOOR}'"
        )


class _Loaded(NamedTuple):
    """Of M samples: (M, n, 3) normalised points, (M, 3) centroids in metres, (M,) labels, targets by head, parts."""

    points: np.ndarray
    centroids: np.ndarray
    labels: np.ndarray
    targets: dict[str, np.ndarray]
    parts: np.ndarray | None  # (M, n)


class CloudLoader:
    """The first `num_points` of chosen samples, normalised once and kept in memory."""

    def __init__(
        self,
        dataset: PreparedDataset,
        sample_ids: Sequence[str],
        num_points: int,
        find_neighbours: FindNeighbours | None = None,
        heads: Sequence[str] = (),
        more: Sequence[PreparedDataset] = (),
    ) -> None:
        """Load clouds.

        Args:
            dataset: clouds.
            sample_ids: which, in order.
            num_points: of each cloud.
            find_neighbours: done once per cloud, when it is first needed, before any augmentation: give it only with
                augmentations that leave its result as it is.
            heads: names of the heads that the batches hold targets for; with "door" among them samples without
                one are allowed, and labelled `IGNORE_INDEX`.
            more: data sets whose samples follow, all of them.

        Raises:
            ConfigError: more points are asked for than the data set holds, a sample shows no door, or nobody knows the
                parts of the points.
        """
        chosen = [(dataset, list(sample_ids)), *((each, each.sample_ids) for each in more)]
        self.sample_ids = [sample for _, samples in chosen for sample in samples]
        loaded = [_load(source, samples, num_points, heads) for source, samples in chosen]
        self._points = _joined([each.points for each in loaded])
        self.centroids = _joined([each.centroids for each in loaded])  # (M, 3) metres
        self._labels = _joined([each.labels for each in loaded])
        self._targets = {name: _joined([each.targets[name] for each in loaded]) for name in loaded[0].targets}
        parts = [each.parts for each in loaded if each.parts is not None]
        self._parts = _joined(parts) if parts else None
        self._neighbours = (
            None if find_neighbours is None else _KnownNeighbours(find_neighbours, self._points)
        )

    def __len__(self) -> int:
        return len(self._labels)

    def in_order(self, batch_size: int) -> Iterator[Batch]:
        """Every sample once, in order, unchanged."""
        for start in range(0, len(self), batch_size):
            yield self._batch(np.arange(start, min(start + batch_size, len(self))), None)

    def shuffled(
        self,
        batch_size: int,
        augmentation: Augmentation,
        seed: Sequence[int],
        skip: int = 0,
        limit: int | None = None,
    ) -> Iterator[Batch]:
        """One training epoch: shuffled, augmented, an incomplete last batch and the first `skip` left out.

        With a limit an epoch is so many clouds, drawn anew, and not all.
        """
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(self))[:limit]
        batch_size = min(batch_size, len(order))
        num_points = self._points.shape[1]
        for number, start in enumerate(range(0, len(order) - batch_size + 1, batch_size)):
            draw = draw_augmentation(augmentation, rng, batch_size, num_points)
            if number >= skip:
                yield self._batch(order[start : start + batch_size], draw)

    def _batch(self, chosen: np.ndarray, draw: AugmentationDraw | None) -> Batch:
        points = self._points[chosen]
        if draw is not None:
            points = apply_augmentation(points, draw)
        known = None if self._neighbours is None else self._neighbours(chosen)
        door = {name: values[chosen] for name, values in self._targets.items()}
        targets = {name: torch.from_numpy(values) for name, values in augment_targets(door, draw).items()}
        if self._parts is not None:
            targets[PARTS] = torch.from_numpy(POINT_HEADS[PARTS].target(self._parts[chosen]))
        return Batch(torch.from_numpy(points), torch.from_numpy(self._labels[chosen]), known, targets)


def _joined(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays behind one another; one alone is large, and not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _load(
    dataset: PreparedDataset, sample_ids: Sequence[str], num_points: int, heads: Sequence[str]
) -> _Loaded:
    """Samples of one data set; arguments and errors are those of `CloudLoader`."""
    if num_points > dataset.num_points:
        raise ConfigError(f"{dataset.folder}: holds {dataset.num_points} points a cloud, not {num_points}")
    indices = np.array([dataset.index_of(sample) for sample in sample_ids], dtype=np.int64)
    # A prefix of a farthest-point order is the farthest-point sample of that size.
    points = dataset.clouds[indices, :num_points]
    centroids_m = centroids(points)
    check_states(dataset, sample_ids, heads)
    labels = np.where(dataset.labels[indices] < len(DoorState), dataset.labels[indices], IGNORE_INDEX)
    targets = head_targets([dataset.rows[index] for index in indices], centroids_m, heads)
    parts = dataset.parts_of(indices, num_points) if PARTS in heads else None
    return _Loaded(normalize(points), centroids_m, labels, targets, parts)


class _KnownNeighbours:
    """Neighbours of clouds by their numbers, searched at the first request."""

    def __init__(self, find: FindNeighbours, points: np.ndarray) -> None:
        self._find, self._points = find, points
        self._searched = torch.zeros(len(points), dtype=torch.bool)
        self._kept: tuple[Tensor, ...] = ()

    def __call__(self, chosen: np.ndarray) -> tuple[Tensor, ...]:
        clouds = torch.from_numpy(chosen)
        new = clouds[~self._searched[clouds]]
        if len(new):
            self._search(new)
        return tuple(kept[clouds].long() for kept in self._kept)

    @torch.no_grad()
    def _search(self, new: Tensor) -> None:
        found = self._find(torch.from_numpy(self._points[new.numpy()]))
        if not self._kept:
            count, num_points, _ = self._points.shape
            smallest = torch.int16 if num_points <= 2**15 else torch.int32  # a million indices a cloud add up
            self._kept = tuple(torch.empty(count, *each.shape[1:], dtype=smallest) for each in found)
        for kept, each in zip(self._kept, found, strict=True):
            kept[new] = each.to(kept.dtype)
        self._searched[new] = True
