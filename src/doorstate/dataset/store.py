# SPDX-License-Identifier: Apache-2.0
"""A prepared data set on disk: `dataset.json`, `manifest.csv`, `clouds.npy`, and `parts.npy` where parts are known."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from doorstate.errors import DatasetError
from doorstate.files import write_text
from doorstate.simulation.generate import replay
from doorstate.simulation.manifest import read_csv, unflatten
from doorstate.simulation.shading import shade
from doorstate.types import STATES, Points

MANIFEST, CLOUDS, PARTS, DESCRIPTION = "manifest.csv", "clouds.npy", "parts.npy", "dataset.json"


class DatasetDescription(BaseModel):
    """What a prepared folder holds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["simulated", "imported"]
    source: str
    num_points: int
    samples: int
    doorstate_version: str

    def save(self, folder: Path) -> None:
        """Write it; the folder counts as complete from here on."""
        write_text(folder / DESCRIPTION, self.model_dump_json(indent=2) + "\n")


class PreparedDataset:
    """Rows and clouds in the same order; clouds are memory-mapped and in farthest-point order."""

    def __init__(
        self,
        folder: Path,
        description: DatasetDescription,
        rows: list[dict[str, str]],
        clouds: NDArray[np.float32],
        parts: NDArray[np.uint8] | None,
    ) -> None:
        self.folder = folder
        self.description = description
        self.rows = rows
        self.clouds = clouds  # (M, n, 3) metres
        self._parts = parts

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def num_points(self) -> int:
        """Points of every cloud."""
        return self.description.num_points

    @cached_property
    def labels(self) -> NDArray[np.int64]:
        """(M,) class labels, doorstate.types.DoorState."""
        return np.array([STATES.index(row["state"]) for row in self.rows], dtype=np.int64)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {row["sample_id"]: index for index, row in enumerate(self.rows)}

    def index_of(self, sample_id: str) -> int:
        """Row number of a sample.

        Raises:
            DatasetError: the data set has no such sample.
        """
        if sample_id not in self._index:
            raise DatasetError(f"{self.folder}: holds no sample {sample_id!r}")
        return self._index[sample_id]

    def cloud(self, index: int) -> Points:
        """(n, 3) metres, sensor frame."""
        return np.array(self.clouds[index])

    def parts(self, index: int) -> NDArray[np.uint8] | None:
        """(n,) part of every point (doorstate.types.Part), or None where nobody knows."""
        return None if self._parts is None else np.array(self._parts[index])

    def image(self, index: int) -> NDArray[np.uint8] | None:
        """(H, W, 3) shaded picture, rendered anew from the row; None for imported clouds."""
        if self.description.kind != "simulated":
            return None
        row = unflatten(self.rows[index])
        return shade(replay(row).full, row.camera.intrinsics())


def open_dataset(folder: Path) -> PreparedDataset:
    """Open a prepared data set.

    Raises:
        DatasetError: missing, incomplete or inconsistent.
    """
    path = folder / DESCRIPTION
    if not path.is_file():
        raise DatasetError(f"{folder}: no prepared data set here; make one with 'doorstate prepare'")
    try:
        description = DatasetDescription.model_validate_json(path.read_text(encoding="utf-8"))
        clouds = np.load(folder / CLOUDS, mmap_mode="r", allow_pickle=False)
        parts_path = folder / PARTS
        parts = np.load(parts_path, mmap_mode="r", allow_pickle=False) if parts_path.is_file() else None
    except ValidationError as error:
        raise DatasetError(f"{path}: {error.errors()[0]['msg']}") from error
    except (OSError, ValueError, EOFError) as error:
        raise DatasetError(f"{folder}: damaged ({error}); delete it and prepare it again") from error
    rows = read_csv(folder / MANIFEST)
    shape = (description.samples, description.num_points, 3)
    if clouds.shape != shape or clouds.dtype != np.float32 or len(rows) != description.samples:
        raise DatasetError(
            f"{folder}: {CLOUDS} {clouds.shape} and {len(rows)} manifest rows, expected {shape}"
        )
    if parts is not None and (parts.shape != shape[:2] or parts.dtype != np.uint8):
        raise DatasetError(f"{folder}: {PARTS} is {parts.shape}, expected {shape[:2]}")
    for column in ("sample_id", "state"):
        if rows and column not in rows[0]:
            raise DatasetError(f"{folder / MANIFEST}: has no column {column!r}")
    unknown = {row["state"] for row in rows} - set(STATES)
    if unknown:
        raise DatasetError(
            f"{folder / MANIFEST}: unknown state {sorted(unknown)[0]!r}, use {', '.join(STATES)}"
        )
    return PreparedDataset(folder, description, rows, clouds, parts)
