# SPDX-License-Identifier: Apache-2.0
"""Clouds of a piece of work in one `.npz` file, and arrays of many pieces joined to one `.npy` file."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from doorstate._files import atomic_path
from doorstate._input import open_input
from doorstate.errors import DatasetError, summarize_exception
from doorstate.types import Points


class Sample(NamedTuple):
    """Cloud made from a row of the source, or the reason why there is none."""

    cloud: Points | None  # (n, 3) in farthest-point order
    parts: NDArray[np.uint8] | None = None  # (n,) parts of its points if known
    columns: Mapping[str, str] = MappingProxyType({})  # in place of those of the row, and more
    reason: str = ""  # of a cloud that is left out


class PieceClouds:
    """Samples of the rows of a piece of work: one or more for each row."""

    def __init__(self, num_points: int) -> None:
        self._num_points = num_points
        self._clouds: list[Points] = []
        self._parts: list[NDArray[np.uint8]] = []
        self._samples: list[list[tuple[dict[str, str], str]]] = []

    def add(self, samples: Sequence[Sample]) -> None:
        """Append the samples of the next row."""
        self._samples.append([(dict(sample.columns), sample.reason) for sample in samples])
        self._clouds += [sample.cloud for sample in samples if sample.cloud is not None]
        self._parts += [sample.parts for sample in samples if sample.parts is not None]

    def save(self, path: Path) -> None:
        """Write the piece."""
        with atomic_path(path) as temporary:
            np.savez(
                temporary,
                clouds=np.array(self._clouds, dtype=np.float32).reshape(-1, self._num_points, 3),
                parts=np.array(self._parts, dtype=np.uint8).reshape(-1, self._num_points),
                samples=np.array(json.dumps(self._samples)),
            )


class SavedPieces(NamedTuple):
    """Files of `PieceClouds` in the order of their rows."""

    paths: Sequence[Path]
    samples: list[list[tuple[dict[str, str], str]]]  # by row: columns and reason, "" for clouds that are kept

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Self:
        """Read the columns and reasons of all pieces.

        Raises:
            DatasetError: one is damaged.
        """
        samples: list[list[tuple[dict[str, str], str]]] = []
        for path in paths:
            with _open_piece(path) as piece:
                samples += json.loads(str(piece["samples"]))
        return cls(paths, samples)

    def lines(self, rows: Sequence[Mapping[str, str]]) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
        """Return the lines of the clouds that are kept, and sample_id, file and reason of the others.

        Args:
            rows: rows of the source.
        """
        kept, rejected = [], []
        for row, samples in zip(rows, self.samples, strict=True):
            for columns, reason in samples:
                line = {**row, **columns}
                if reason:
                    names = {"sample_id": line["sample_id"], "file": line.get("file", "")}
                    rejected.append({**names, "reason": reason})
                else:
                    kept.append(line)
        return kept, rejected

    def left_out(self, rows: Sequence[Mapping[str, str]]) -> dict[str, int]:
        """Return the number of rows by state that have no cloud at all."""
        pairs = zip(rows, self.samples, strict=True)
        states = sorted(row["state"] for row, samples in pairs if all(reason for _, reason in samples))
        return {state: states.count(state) for state in dict.fromkeys(states)}

    def join_clouds(self, target: Path, num_points: int) -> None:
        """Write the clouds of all pieces as one array (M, n, 3)."""
        shape = (self._num_kept, num_points, 3)
        write_concatenated(target, self._arrays("clouds"), shape, np.float32)

    def join_parts(self, target: Path, num_points: int) -> None:
        """Write the parts of all pieces as one array (M, n)."""
        write_concatenated(target, self._arrays("parts"), (self._num_kept, num_points), np.uint8)

    @property
    def _num_kept(self) -> int:
        return sum(not reason for samples in self.samples for _, reason in samples)

    def _arrays(self, name: str) -> Iterator[NDArray[Any]]:
        for path in self.paths:
            with _open_piece(path) as piece:
                yield piece[name]


@contextmanager
def _open_piece(path: Path) -> Iterator[Any]:
    """Open the arrays of a piece; errors of a damaged one become a `DatasetError`."""
    try:
        with open_input(path, None, DatasetError) as stream, np.load(stream, allow_pickle=False) as piece:
            yield piece
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise DatasetError(
            f"damaged ({summarize_exception(error)})", path=path, hint="delete it and prepare again"
        ) from error


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
