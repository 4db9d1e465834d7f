# SPDX-License-Identifier: Apache-2.0
"""Clouds of a piece of work in one `.npz` file, and arrays of many pieces joined to one `.npy` file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from doorstate._files import atomic_path
from doorstate.types import Points


class PieceClouds:
    """Prepared clouds of a piece, and for each sample the reason why it is left out, or ""."""

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
        shape = (self.reasons.count(""), num_points, 3)
        write_concatenated(target, self._arrays("clouds"), shape, np.float32)

    def join_parts(self, target: Path, num_points: int) -> None:
        """Write the parts of all pieces as one array (M, n)."""
        write_concatenated(target, self._arrays("parts"), (self.reasons.count(""), num_points), np.uint8)

    def _arrays(self, name: str) -> Iterator[NDArray[Any]]:
        for path in self.paths:
            with np.load(path, allow_pickle=False) as piece:
                yield piece[name]


def write_concatenated(
    target: Path, arrays: Iterable[NDArray[Any]], shape: tuple[int, ...], dtype: type[np.generic]
) -> None:
    """Write arrays one after another into one `.npy` file; only one of them needs to be in memory.

    Args:
        target: file to write.
        arrays: arrays that differ in the length of the first axis only.
        shape: shape of all of them together.
        dtype: number type of the file.
    """
    header = {"descr": np.lib.format.dtype_to_descr(np.dtype(dtype)), "fortran_order": False, "shape": shape}
    # No memory map: on a full disk, writing to one ends the process with SIGBUS.
    with atomic_path(target) as temporary, temporary.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, header)
        for array in arrays:
            stream.write(np.ascontiguousarray(array, dtype=dtype).data)
