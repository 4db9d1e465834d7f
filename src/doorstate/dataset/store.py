# SPDX-License-Identifier: Apache-2.0
"""A prepared data set on disk: `dataset.json`, `manifest.csv`, `clouds.npy`, and `parts.npy` where parts are known.

Of a simulated one the manifest is enough to look at it: where `dataset.json` says so, single clouds are replayed.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from doorstate._files import read_csv, write_text
from doorstate._models import FrozenModel
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.sampled import sample_frame
from doorstate.errors import ConfigError, DatasetError, first_validation_error
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.manifest import unflatten
from doorstate.simulation.shading import shade
from doorstate.types import NO_DOOR, STATES, Indices, Points

MANIFEST, CLOUDS, PARTS, DESCRIPTION = "manifest.csv", "clouds.npy", "parts.npy", "dataset.json"
_LABELS = (*STATES, NO_DOOR)
_KEPT_CLOUDS = 512  # of those that are not stored
_T = TypeVar("_T")


class DatasetDescription(FrozenModel):
    """What a prepared folder holds."""

    kind: Literal["simulated", "imported"]
    source: str
    num_points: int
    samples: int
    doorstate_version: str
    clouds: Literal["stored", "replayed"] = "stored"  # replayed: from the rows of a simulated data set
    max_depth_m: float | None = None  # what lay farther ahead was left out
    thin: bool = False  # chosen from some rows and columns of each image, as a predictor does

    @property
    def spec(self) -> CloudSpec:
        """Preparation of its clouds."""
        return CloudSpec(num_points=self.num_points, thin=self.thin, max_depth_m=self.max_depth_m)

    def save(self, folder: Path) -> None:
        """Write it; the folder counts as complete from here on."""
        write_text(folder / DESCRIPTION, self.model_dump_json(indent=2) + "\n")


class PreparedDataset:
    """Rows and clouds in the same order; clouds are memory-mapped and in farthest-point order.

    Without stored clouds, as a simulated data set may be, single clouds are rendered and sampled when asked for.
    """

    def __init__(
        self,
        folder: Path,
        description: DatasetDescription,
        rows: list[dict[str, str]],
        clouds: NDArray[np.float32] | None,
        parts: NDArray[np.uint8] | None,
    ) -> None:
        self.folder = folder
        self.description = description
        self.rows = rows
        self._clouds = clouds
        self._parts = parts
        self._made: dict[int, tuple[Points, NDArray[np.uint8]]] = {}
        self._rendered: dict[int, Frame] = {}

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def num_points(self) -> int:
        """Points of every cloud."""
        return self.description.num_points

    @property
    def max_depth_m(self) -> float | None:
        """How far ahead clouds reach, the farthest if cameras differ; None where nobody knows."""
        known = {row.get("camera.max_depth_m", "") for row in self.rows}
        seen_m = None if "" in known else max(map(float, known), default=None)
        reaches_m = (seen_m, self.description.max_depth_m)
        return min((reach_m for reach_m in reaches_m if reach_m is not None), default=None)

    @property
    def clouds(self) -> NDArray[np.float32]:
        """(M, n, 3) metres.

        Raises:
            DatasetError: only rows are stored.
        """
        if self._clouds is None:
            raise DatasetError(
                f"{self.folder}: holds rows without clouds; make them with 'doorstate simulate' and 'doorstate prepare'"
            )
        return self._clouds

    @cached_property
    def labels(self) -> NDArray[np.int64]:
        """(M,) class labels, doorstate.types.DoorState; 3 of a scene without a door."""
        return np.array([_LABELS.index(row["state"]) for row in self.rows], dtype=np.int64)

    @property
    def sample_ids(self) -> list[str]:
        """Names of all samples, in order."""
        return [row["sample_id"] for row in self.rows]

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

    def cloud(self, index: int, num_points: int | None = None) -> Points:
        """(n, 3) metres, sensor frame; the first `num_points` of them if given."""
        if self._clouds is None:
            return self._make(index, num_points)[0].copy()
        return np.array(self._clouds[index, :num_points])

    def parts(self, index: int, num_points: int | None = None) -> NDArray[np.uint8] | None:
        """(n,) part of every point (doorstate.types.Part), or None where nobody knows."""
        if self._clouds is None:
            return self._make(index, num_points)[1].copy()
        return None if self._parts is None else np.array(self._parts[index, :num_points])

    @property
    def knows_parts(self) -> bool:
        """Whether the parts of all points are stored."""
        return self._parts is not None

    def parts_of(self, indices: Indices, num_points: int) -> NDArray[np.uint8]:
        """(M, n) parts of the first points of samples by number.

        Raises:
            ConfigError: nobody knows them, or only rows are stored.
        """
        if self._parts is None:
            raise ConfigError(f"{self.folder}: holds no parts of points: leave out the head 'parts'")
        return np.array(self._parts[indices, :num_points])

    def _make(self, index: int, num_points: int | None) -> tuple[Points, NDArray[np.uint8]]:
        spec = self.description.spec
        count = num_points or spec.num_points
        if index not in self._made or len(self._made[index][0]) < count:
            _keep(
                self._made,
                index,
                sample_frame(self._frame(index), spec.model_copy(update={"num_points": count})),
                _KEPT_CLOUDS,
            )
        points, parts = self._made[index]
        return points[:count], parts[:count]

    def _frame(self, index: int) -> Frame:
        """The frame of a row, rendered anew; the last one is kept, for its picture and its cloud."""
        if index not in self._rendered:
            _keep(self._rendered, index, replay(unflatten(self.rows[index])), 1)
        return self._rendered[index]

    def raw_cloud(self, index: int) -> Points:
        """(H, W, 3) metres as the sensor gives them, rendered anew; of imported clouds what is stored."""
        if self.description.kind != "simulated":
            return self.cloud(index)
        return self._frame(index).points.copy()

    def raw_clouds(self, count: int) -> list[Points]:
        """`raw_cloud` of so many samples, spread over the data set."""
        step = max(1, len(self.rows) // count)
        return [self.raw_cloud(index) for index in range(0, len(self.rows), step)[:count]]

    def image(self, index: int) -> NDArray[np.uint8] | None:
        """(H, W, 3) shaded picture, rendered anew from the row; None for imported clouds."""
        if self.description.kind != "simulated":
            return None
        return shade(self._frame(index).full, unflatten(self.rows[index]).camera.intrinsics())


def _keep(kept: dict[int, _T], index: int, value: _T, most: int) -> None:
    """Put a value among the kept ones in place of the oldest, if there are `most` already."""
    if len(kept) >= most:
        kept.pop(next(iter(kept)))
    kept[index] = value


def is_prepared(folder: Path) -> bool:
    """Whether `folder` holds a prepared data set."""
    return (folder / DESCRIPTION).is_file()


def manifest_path(folder: Path) -> Path:
    """Return the manifest in a data set folder, plain or compressed.

    Raises:
        DatasetError: there is none.
    """
    for path in (folder / MANIFEST, folder / f"{MANIFEST}.gz"):
        if path.is_file():
            return path
    raise DatasetError(f"no {MANIFEST} in this folder", path=folder)


def open_dataset(folder: Path) -> PreparedDataset:
    """Open a prepared data set.

    Raises:
        DatasetError: missing, incomplete or inconsistent.
    """
    path = folder / DESCRIPTION
    if not is_prepared(folder):
        raise DatasetError(f"{folder}: no prepared data set here; make one with 'doorstate prepare'")
    try:
        description = DatasetDescription.model_validate_json(path.read_text(encoding="utf-8"))
        replayed = description.clouds == "replayed"
        clouds = None if replayed else np.load(folder / CLOUDS, mmap_mode="r", allow_pickle=False)
        parts_path = folder / PARTS
        parts = np.load(parts_path, mmap_mode="r", allow_pickle=False) if parts_path.is_file() else None
    except ValidationError as error:
        raise DatasetError(f"{path}: {first_validation_error(error)}") from error
    except (OSError, ValueError, EOFError) as error:
        raise DatasetError(f"{folder}: damaged ({error}); delete it and prepare it again") from error
    rows = read_csv(manifest_path(folder))
    shape = (description.samples, description.num_points, 3)
    if len(rows) != description.samples or (
        clouds is not None and (clouds.shape != shape or clouds.dtype != np.float32)
    ):
        found = "no clouds" if clouds is None else f"{CLOUDS} {clouds.shape}"
        raise DatasetError(f"{folder}: {found} and {len(rows)} manifest rows, expected {shape}")
    if parts is not None and (parts.shape != shape[:2] or parts.dtype != np.uint8):
        raise DatasetError(f"{folder}: {PARTS} is {parts.shape}, expected {shape[:2]}")
    for column in ("sample_id", "state"):
        if rows and column not in rows[0]:
            raise DatasetError(f"{folder / MANIFEST}: has no column {column!r}")
    unknown = {row["state"] for row in rows} - set(_LABELS)
    if unknown:
        raise DatasetError(
            f"{folder / MANIFEST}: unknown state {sorted(unknown)[0]!r}, use {', '.join(_LABELS)}"
        )
    return PreparedDataset(folder, description, rows, clouds, parts)
