# SPDX-License-Identifier: Apache-2.0
"""Neighbours of clouds, searched once, and kept on the device of the training where they fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

FindNeighbours = Callable[[Tensor], tuple[Tensor, ...]]
"""From (B, n, 3) points to (B, ...) int64 indices into them."""

_SHARE_OF_MEMORY = 0.5  # of what is free on a device


def to_device(tensor: Tensor, device: torch.device) -> Tensor:
    """Return a tensor on a device; a copy to a CUDA device goes through pinned memory, and nothing waits for it."""
    if device.type == "cuda" and not tensor.is_cuda:
        return tensor.pin_memory().to(device, non_blocking=True)
    return tensor.to(device)


class NeighbourCache:
    """Neighbours of clouds by their row numbers, searched at the first request.

    Args:
        find: search.
        points: (M, n, 3) clouds.
        device: device of the search and of its results.
    """

    def __init__(self, find: FindNeighbours, points: np.ndarray, device: torch.device) -> None:
        self._find, self._points, self._device = find, points, device
        self._searched = torch.zeros(len(points), dtype=torch.bool)
        self._cache: tuple[Tensor, ...] = ()

    def __call__(self, indices: np.ndarray) -> tuple[Tensor, ...]:
        """Return the neighbours of clouds, int64 on the device."""
        clouds = torch.from_numpy(indices)
        new = clouds[~self._searched[clouds]]
        if len(new):
            self._search(new)
        return tuple(
            to_device(cached[to_device(clouds, cached.device)], self._device).long() for cached in self._cache
        )

    @torch.no_grad()
    def _search(self, new: Tensor) -> None:
        neighbours = self._find(to_device(torch.from_numpy(self._points[new.numpy()]), self._device))
        if not self._cache:
            self._cache = self._allocate(neighbours)
        for cached, part in zip(self._cache, neighbours, strict=True):
            cached[to_device(new, cached.device)] = part.to(cached.device, cached.dtype)
        self._searched[new] = True

    def _allocate(self, neighbours: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
        count, num_points, _ = self._points.shape
        # A cloud can have a million indices.
        smallest = torch.int16 if num_points <= 2**15 else torch.int32
        size = smallest.itemsize * count * sum(part[0].numel() for part in neighbours)
        place = self._device if _fits(size, self._device) else torch.device("cpu")
        return tuple(torch.empty(count, *part.shape[1:], dtype=smallest, device=place) for part in neighbours)


def _fits(size: int, device: torch.device) -> bool:
    """Return True if that many bytes leave enough memory of a device free."""
    return device.type != "cuda" or size <= _SHARE_OF_MEMORY * torch.cuda.mem_get_info(device)[0]
