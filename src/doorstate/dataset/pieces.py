# SPDX-License-Identifier: Apache-2.0
"""Clouds of a piece of work in one `.npz` file, and the arrays of all pieces as one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from doorstate._files import atomic_path
from doorstate.types import Points


class PieceClouds:
    """Prepared clouds of a piece, and for each of its samples the reason for which it is left out, or ""."""

    def __init__(self, num_points: int) -> None:
        self._num_points = num_points
        self._clouds: list[Points] = []
        self._parts: list[NDArray[np.uint8]] = []
        self._reasons: list[str] = []

    def add(self, cloud: Points, parts: NDArray[np.uint8] | None = None) -> None:
        """Append the cloud (n, 3) of the next sample, and the parts of its points if known."""
        self._clouds.append(cloud)
        if parts is not None:
            self._parts.append(parts)
        self._reasons.append("")

    def reject(self, reason: str) -> None:
        """Leave the next sample out."""
        self._reasons.append(reason)

    def save(self, path: Path) -> None:
        """Write the piece."""
        with atomic_path(path) as temporary:
            np.savez(
                temporary,
                clouds=np.array(self._clouds, dtype=np.float32).reshape(-1, self._num_points, 3),
                parts=np.array(self._parts, dtype=np.uint8).reshape(-1, self._num_points),
                reasons=np.array(self._reasons, dtype=str),
            )


class _Array(NamedTuple):
    name: str
    shape: tuple[int, ...]  # of one sample
    dtype: type


class SavedPieces(NamedTuple):
    """Files of `PieceClouds` in the order of their samples."""

    paths: Sequence[Path]
    reasons: list[str]  # of all samples, "" for those that are kept

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Self:
        """Read the reasons of all pieces."""
        reasons: list[str] = []
        for path in paths:
            with np.load(path, allow_pickle=False) as piece:
                reasons += [str(reason) for reason in piece["reasons"]]
        return cls(paths, reasons)

    def join_clouds(self, target: Path, num_points: int) -> None:
        """Write the clouds of all pieces as one array (M, n, 3)."""
        self._join(target, _Array("clouds", (num_points, 3), np.float32))

    def join_parts(self, target: Path, num_points: int) -> None:
        """Write the parts of all pieces as one array (M, n)."""
        self._join(target, _Array("parts", (num_points,), np.uint8))

    def _join(self, target: Path, array: _Array) -> None:
        shape = (self.reasons.count(""), *array.shape)
        with atomic_path(target) as temporary:
            joined = np.lib.format.open_memmap(temporary, mode="w+", dtype=array.dtype, shape=shape)
            start = 0
            for path in self.paths:
                with np.load(path, allow_pickle=False) as piece:
                    part = piece[array.name]
                joined[start : start + len(part)] = part
                start += len(part)
            joined.flush()
            del joined
