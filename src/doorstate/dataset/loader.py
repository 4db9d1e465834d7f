# SPDX-License-Identifier: Apache-2.0
"""Batches of normalised clouds; the order and augmentation of an epoch depend on its seed alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from doorstate.clouds.augmentation import (
    Augmentation,
    AugmentationDraw,
    apply_augmentation,
    draw_augmentation,
)
from doorstate.clouds.corruption import Corruption, CorruptionDraw
from doorstate.clouds.normalization import Placement
from doorstate.dataset.corruptor import Corruptor, Openings
from doorstate.dataset.neighbour_cache import FindNeighbours, NeighbourCache, to_device
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError
from doorstate.networks.heads import IGNORE_INDEX, POINT_HEADS, augment_targets, head_targets
from doorstate.types import DOOR, LABELS, NO_DOOR, PARTS, STATES

MOST_STORED = 2  # points that are held for each point of a corrupted cloud, if a data set stores as many
_CPU = torch.device("cpu")


class Batch(NamedTuple):
    """Normalised points (B, n, 3) float32, labels (B,) int64, precomputed neighbourhoods, and targets by head."""

    points: Tensor
    labels: Tensor
    neighbourhoods: tuple[Tensor, ...] | None = None
    targets: Mapping[str, Tensor] = MappingProxyType({})


def check_states(dataset: PreparedDataset, sample_ids: Sequence[str], heads: Sequence[str]) -> None:
    """Raise ConfigError if samples have no state and no head predicts the presence of a door."""
    if DOOR in heads:
        return
    without = [sample for sample in sample_ids if dataset.labels[dataset.index_of(sample)] >= len(STATES)]
    if without:
        raise ConfigError(
            f"{len(without)} samples show no door, or one of unknown state, such as {without[0]}",
            path=dataset.folder,
            hint=f"leave them out, or add the head {DOOR!r}",
        )


class _Loaded(NamedTuple):
    """Points (M, S, 3), their placement, labels (M,), doors, targets by head, and parts of M samples."""

    points: np.ndarray
    placement: Placement
    labels: np.ndarray
    has_door: np.ndarray  # (M,) bool
    targets: dict[str, np.ndarray]
    parts: np.ndarray | None  # (M, S)


class CloudLoader:
    """The first `num_points` of selected samples, normalised once and held in memory."""

    def __init__(
        self,
        dataset: PreparedDataset,
        sample_ids: Sequence[str],
        num_points: int,
        find_neighbours: FindNeighbours | None = None,
        heads: Sequence[str] = (),
        extra: Sequence[tuple[PreparedDataset, Sequence[str]]] = (),
        corruption: Corruption | None = None,
        device: torch.device = _CPU,
    ) -> None:
        """Load clouds.

        Args:
            dataset: prepared clouds.
            sample_ids: samples to load, in order.
            num_points: points of each cloud.
            find_neighbours: search that runs once per cloud, before augmentation; only for augmentations that do not
                change its result.
            heads: names of the heads that need targets; with "door" among them, samples without a door, and doors of
                unknown state, are allowed and labelled `IGNORE_INDEX`.
            extra: samples of other data sets to append.
            corruption: random losses of shuffled crops, which change neighbours. Lost points are replaced by later
                ones where the data sets store more than `num_points`; the rest is repeated.
            device: device of the batches and of the search.

        Raises:
            ConfigError: a data set has fewer points, samples have no state, the parts of points are not stored, or
                whole clouds, whose centres depend on all points, are to be corrupted.
        """
        selected = [(dataset, sample_ids), *extra]
        self.sample_ids = [sample for _, samples in selected for sample in samples]
        corruption = None if corruption is None or corruption.changes_nothing else corruption
        if corruption is not None and dataset.normalization.centre_m is None:
            raise ConfigError("holds no crops to corrupt", path=dataset.folder, field="corruption")
        stored = num_points
        if corruption is not None:
            least = min(source.num_points for source, _ in selected)
            stored = max(num_points, min(MOST_STORED * num_points, least))
        with_parts = PARTS in heads or (corruption is not None and corruption.mix > 0)
        loaded = [_load(source, samples, stored, heads, with_parts) for source, samples in selected]
        self._num_points, self._num_own = num_points, len(sample_ids)
        self._points = _concatenate([samples.points for samples in loaded])
        self._normalization = dataset.normalization
        centres = _concatenate([samples.placement.centres for samples in loaded])
        self.placement = Placement(centres, self._normalization.scale_m)
        self._labels = _concatenate([samples.labels for samples in loaded])
        self._has_door = _concatenate([samples.has_door for samples in loaded])
        self._targets = {
            name: _concatenate([samples.targets[name] for samples in loaded]) for name in loaded[0].targets
        }
        parts = [samples.parts for samples in loaded if samples.parts is not None]
        self._parts = _concatenate(parts) if parts else None
        self._device = device
        self._neighbours = None
        if find_neighbours is not None:
            self._neighbours = NeighbourCache(find_neighbours, self._points, device)
        self._has_part_targets = PARTS in heads
        self._corruptor = None
        if corruption is not None:
            rows = [
                source.rows[source.index_of(sample)] for source, samples in selected for sample in samples
            ]
            self._corruptor = Corruptor(
                corruption,
                self._points,
                self._parts,
                _openings(rows, self.placement, self._has_door),
                self._has_door,
                self._normalization.scale_m,
            )

    def __len__(self) -> int:
        return len(self._labels)

    def in_order(self, batch_size: int) -> Iterator[Batch]:
        """Yield every sample once, in order and without augmentation."""
        for start in range(0, len(self), batch_size):
            yield self._batch(np.arange(start, min(start + batch_size, len(self))))

    def shuffled(
        self,
        batch_size: int,
        augmentation: Augmentation,
        seed: Sequence[int],
        skip: int = 0,
        limit: int | None = None,
        no_door_share: float | None = None,
        own_share: float | None = None,
        part: tuple[int, int] = (0, 1),
    ) -> Iterator[Batch]:
        """Yield one training epoch, shuffled, corrupted and augmented, without an incomplete last batch.

        Args:
            batch_size: clouds of a batch; at most the clouds of the epoch.
            augmentation: random changes of points and targets.
            seed: seed of the epoch.
            skip: number of batches to leave out at the start.
            limit: number of random clouds in the epoch; None is all.
            no_door_share: share of clouds without a door in the epoch; the others, or these, are then drawn more
                often. None: as in the data.
            own_share: share of clouds of the first data set in the epoch, those of each label equally often;
                `no_door_share` is then that of the rest. None: as in the data.
            part: (number, of equal parts) of each batch to yield; what is drawn does not depend on it.
        """
        rng = np.random.default_rng(seed)
        if no_door_share is None and own_share is None:
            order = rng.permutation(len(self))[:limit]
        else:
            order = self._draw(rng, min(len(self), limit or len(self)), no_door_share, own_share or 0.0)
        number_of_part, parts = part
        share = min(batch_size, len(order)) // parts
        batch_size = share * parts
        own = slice(number_of_part * share, (number_of_part + 1) * share)
        across = self._normalization.across
        for number, start in enumerate(range(0, len(order) - batch_size + 1, batch_size)):
            draw = draw_augmentation(augmentation, rng, batch_size, self._num_points, across)
            losses = None if self._corruptor is None else self._corruptor.draw(rng, batch_size)
            if number >= skip:
                own_losses = None if losses is None else CorruptionDraw(*(values[own] for values in losses))
                yield self._batch(order[start : start + batch_size][own], draw.part(own), own_losses)

    def _draw(
        self, rng: np.random.Generator, count: int, no_door_share: float | None, own_share: float
    ) -> np.ndarray:
        """Return the numbers of `count` samples in random order, with shares of some kinds of them."""
        own = round(own_share * count)
        groups = (
            _own_groups(self._labels[: self._num_own], self._has_door[: self._num_own], own) if own else []
        )
        rest = np.arange(self._num_own if own else 0, len(self))
        if no_door_share is None:
            groups.append((rest, count - own))
        else:
            without = rest[~self._has_door[rest]]
            size = round(no_door_share * (count - own)) if len(without) else 0
            groups += [(without, size), (rest[self._has_door[rest]], count - own - size)]
        drawn = [
            np.resize(np.concatenate([rng.permutation(group) for _ in range(1 + size // len(group))]), size)
            for group, size in groups
            if size
        ]
        return rng.permutation(np.concatenate(drawn))

    def _batch(
        self, indices: np.ndarray, draw: AugmentationDraw | None = None, losses: CorruptionDraw | None = None
    ) -> Batch:
        if self._corruptor is not None and losses is not None:
            points, parts = self._corruptor(indices, losses, self._num_points)
        else:
            points = self._points[indices, : self._num_points]
            parts = None if self._parts is None else self._parts[indices, : self._num_points]
        if draw is not None:
            points = apply_augmentation(points, draw)
        neighbours = None if self._neighbours is None else self._neighbours(indices)
        door = {name: values[indices] for name, values in self._targets.items()}
        targets = {name: torch.from_numpy(values) for name, values in augment_targets(door, draw).items()}
        if parts is not None and self._has_part_targets:
            targets[PARTS] = torch.from_numpy(POINT_HEADS[PARTS].target(parts))
        labels = torch.from_numpy(self._labels[indices])
        on_device = {name: to_device(target, self._device) for name, target in targets.items()}
        return Batch(
            to_device(torch.from_numpy(points), self._device),
            to_device(labels, self._device),
            neighbours,
            on_device,
        )


def _own_groups(
    labels: NDArray[np.int64], has_door: NDArray[np.bool_], count: int
) -> list[tuple[NDArray[np.int64], int]]:
    """Return the numbers of the samples of each label, and the number of samples to draw of each: equally many."""
    kinds = np.where(has_door, labels, len(LABELS))
    groups = [np.flatnonzero(kinds == kind) for kind in np.unique(kinds)]
    ends = [count * number // len(groups) for number in range(len(groups) + 1)]
    return [(group, end - start) for group, (start, end) in zip(groups, pairwise(ends), strict=True)]


def _concatenate(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Concatenate arrays; a single array is not copied, because it may be large."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _openings(
    rows: Sequence[Mapping[str, str]], placement: Placement, has_door: NDArray[np.bool_]
) -> Openings:
    """Return the openings of crops in units of the clouds."""
    targets = head_targets(rows, placement, ("frame", "widths"))
    numbers = np.column_stack([targets["frame"][:, :2], targets["widths"][:, 0]])
    numbers[~has_door] = 0
    return Openings(*numbers.T.astype(np.float32))


def _load(
    dataset: PreparedDataset,
    sample_ids: Sequence[str],
    num_points: int,
    heads: Sequence[str],
    with_parts: bool,
) -> _Loaded:
    """Load samples of one data set; arguments and errors are those of `CloudLoader`."""
    if num_points > dataset.num_points:
        raise ConfigError(
            f"holds {dataset.num_points} points per cloud, not {num_points}",
            path=dataset.folder,
            field="num_points",
        )
    indices = np.array([dataset.index_of(sample) for sample in sample_ids], dtype=np.int64)
    # A prefix of a farthest-point order is the farthest-point sample of that size.
    points = dataset.clouds[indices, :num_points]
    check_states(dataset, sample_ids, heads)
    stored = dataset.labels[indices]
    labels = np.where(stored < len(STATES), stored, IGNORE_INDEX)
    placement = dataset.normalization.placement(points)
    targets = head_targets([dataset.rows[index] for index in indices], placement, heads)
    parts = dataset.parts_of(indices, num_points) if with_parts else None
    has_door = stored != LABELS.index(NO_DOOR)
    return _Loaded(dataset.normalization(points), placement, labels, has_door, targets, parts)
