# SPDX-License-Identifier: Apache-2.0
"""Prepared data sets on disk: `dataset.json`, `manifest.csv`, `clouds.npy`, and `parts.npy` for simulated ones.

A simulated data set may be stored without clouds; single clouds are then rendered from its manifest.
"""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from doorstate._documents import read_json
from doorstate._files import read_csv
from doorstate._input import MAX_SETTINGS_BYTES, check_input
from doorstate.clouds.normalization import NORMALIZATIONS, Normalization
from doorstate.dataset.crops import doorway_of, frame_row
from doorstate.dataset.description import DESCRIPTION_FILE, DatasetDescription
from doorstate.dataset.sampling import sample_crop, sample_frame
from doorstate.doorways.crop import DEFAULT_CROP
from doorstate.errors import ConfigError, DatasetError, first_validation_error
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.manifest import MANIFEST_FILE, unflatten
from doorstate.simulation.shading import shade
from doorstate.types import LABELS, Indices, Points

CLOUDS_FILE, PARTS_FILE = "clouds.npy", "parts.npy"
_CACHED_CLOUDS = 512
_CACHED_IMAGES = 64  # a megabyte each
_T = TypeVar("_T")


class PreparedDataset:
    """Rows and clouds in the same order; clouds are memory-mapped and in farthest-point order.

    Without stored clouds, single clouds are rendered and sampled on request.
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
        self._sampled: dict[int, tuple[Points, NDArray[np.uint8]]] = {}
        self._rendered: dict[int, Frame] = {}
        self._shaded: dict[int, NDArray[np.uint8]] = {}

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def num_points(self) -> int:
        """Number of points of every cloud."""
        return self.description.num_points

    @property
    def normalization(self) -> Normalization:
        """Normalisation of the clouds."""
        return NORMALIZATIONS[self.description.input]

    @property
    def depth_range_m(self) -> float | None:
        """Largest depth of the clouds, the farthest if cameras differ; None if unknown."""
        ranges = {row.get("camera.max_depth_m", "") for row in self.rows}
        camera_m = None if "" in ranges else max(map(float, ranges), default=None)
        limits_m = (camera_m, self.description.max_depth_m)
        return min((limit_m for limit_m in limits_m if limit_m is not None), default=None)

    @property
    def clouds(self) -> NDArray[np.float32]:
        """Clouds (M, n, 3) in metres.

        Raises:
            DatasetError: clouds are not stored.
        """
        if self._clouds is None:
            raise DatasetError("holds rows without clouds", path=self.folder, hint="simulate and prepare it")
        return self._clouds

    @cached_property
    def labels(self) -> NDArray[np.int64]:
        """Positions (M,) in `LABELS`: `DoorState.class_index`, 3 without a door, 4 for a door of unknown state."""
        return np.array([LABELS.index(row["state"]) for row in self.rows], dtype=np.int64)

    @property
    def sample_ids(self) -> list[str]:
        """Names of all samples, in order."""
        return [row["sample_id"] for row in self.rows]

    @cached_property
    def _index(self) -> dict[str, int]:
        return {row["sample_id"]: index for index, row in enumerate(self.rows)}

    def index_of(self, sample_id: str) -> int:
        """Return the row number of a sample.

        Raises:
            DatasetError: no such sample.
        """
        if sample_id not in self._index:
            raise DatasetError(f"holds no sample {sample_id!r}", path=self.folder, field="sample_id")
        return self._index[sample_id]

    def cloud(self, index: int, num_points: int | None = None) -> Points:
        """Return a cloud (n, 3) in metres, sensor frame; only the first `num_points` if set."""
        if self._clouds is None:
            return self._sample(index, num_points)[0].copy()
        return np.array(self._clouds[index, :num_points])

    def parts(self, index: int, num_points: int | None = None) -> NDArray[np.uint8] | None:
        """Return the part (n,) of every point (doorstate.types.Part), or None for imported clouds."""
        if self._clouds is None:
            return self._sample(index, num_points)[1].copy()
        return None if self._parts is None else np.array(self._parts[index, :num_points])

    @property
    def has_parts(self) -> bool:
        """True if the parts of all points are stored."""
        return self._parts is not None

    def parts_of(self, indices: Indices, num_points: int) -> NDArray[np.uint8]:
        """Return the parts (M, n) of the first points of samples by row number.

        Raises:
            ConfigError: parts are not stored.
        """
        if self._parts is None:
            raise ConfigError(
                "holds no parts of points",
                path=self.folder,
                hint="leave out the head 'parts', and mixed crops",
            )
        return np.array(self._parts[indices, :num_points])

    def _sample(self, index: int, num_points: int | None) -> tuple[Points, NDArray[np.uint8]]:
        count = num_points or self.num_points
        if index not in self._sampled or len(self._sampled[index][0]) < count:
            spec, frame = self.description.spec.model_copy(update={"num_points": count}), self._frame(index)
            is_whole = self.description.crops is None
            sampled = sample_frame(frame, spec) if is_whole else sample_crop(frame, self.rows[index], spec)
            _cache(self._sampled, index, sampled, _CACHED_CLOUDS)
        points, parts = self._sampled[index]
        return points[:count], parts[:count]

    def _frame(self, index: int) -> Frame:
        """Render the frame of a row; the last one is cached, because picture and cloud need it."""
        if index not in self._rendered:
            _cache(self._rendered, index, replay(frame_row(self.rows[index])), 1)
        return self._rendered[index]

    def raw_cloud(self, index: int) -> Points:
        """Render the cloud (H, W, 3) in metres before sampling, sensor frame; NaN outside of a crop.

        Imported data sets return the stored cloud.
        """
        doorway = None if self.description.crops is None else doorway_of(self.rows[index])
        if self.description.kind != "simulated":
            cloud = self.cloud(index)
            return cloud if doorway is None else doorway.to_sensor(cloud)
        points = self._frame(index).points.copy()
        if doorway is not None:
            points[~DEFAULT_CROP.contains(doorway.to_doorway(points))] = np.nan
        return points

    def raw_clouds(self, count: int) -> list[Points]:
        """Return `raw_cloud` for `count` samples, spread over the data set."""
        step = max(1, len(self.rows) // count)
        return [self.raw_cloud(index) for index in range(0, len(self.rows), step)[:count]]

    def image(self, index: int) -> NDArray[np.uint8] | None:
        """Render a shaded picture (H, W, 3), or return None for imported clouds."""
        if self.description.kind != "simulated":
            return None
        if index not in self._shaded:
            intrinsics = unflatten(self.rows[index]).camera.intrinsics()
            _cache(self._shaded, index, shade(self._frame(index).full, intrinsics), _CACHED_IMAGES)
        return self._shaded[index].copy()


def _cache(cache: dict[int, _T], index: int, value: _T, size: int) -> None:
    """Add a value to a cache, which drops its oldest entry when it is full."""
    if len(cache) >= size:
        cache.pop(next(iter(cache)))
    cache[index] = value


def is_prepared(folder: Path) -> bool:
    """Return True if `folder` holds a prepared data set."""
    return (folder / DESCRIPTION_FILE).is_file()


def manifest_path(folder: Path) -> Path:
    """Return the manifest in a data set folder, plain or compressed.

    Raises:
        DatasetError: there is none.
    """
    for path in (folder / MANIFEST_FILE, folder / f"{MANIFEST_FILE}.gz"):
        if path.is_file():
            return path
    raise DatasetError(f"no {MANIFEST_FILE} in this folder", path=folder)


def open_dataset(folder: Path) -> PreparedDataset:
    """Open a prepared data set.

    Raises:
        DatasetError: the folder is missing, incomplete or inconsistent.
    """
    path = folder / DESCRIPTION_FILE
    if not is_prepared(folder):
        raise DatasetError("is no prepared data set", path=folder, hint="prepare one first")
    try:
        description = DatasetDescription.model_validate(read_json(path, DatasetError, MAX_SETTINGS_BYTES))
        replayed = description.clouds == "replayed"
        clouds = None if replayed else _map(folder / CLOUDS_FILE)
        parts_path = folder / PARTS_FILE
        parts = _map(parts_path) if parts_path.is_file() else None
    except ValidationError as error:
        raise DatasetError(first_validation_error(error), path=path) from error
    except (OSError, ValueError, EOFError) as error:
        raise DatasetError(
            f"damaged ({error})", path=folder, hint="delete the folder and prepare it again"
        ) from error
    manifest = manifest_path(folder)
    rows = read_csv(manifest)
    _check(description, rows, clouds, parts, manifest)
    return PreparedDataset(folder, description, rows, clouds, parts)


def _map(path: Path) -> NDArray[Any]:
    if path.exists():  # a pipe would wait for a writer
        check_input(path, None, DatasetError)
    array: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return array


def _check(
    description: DatasetDescription,
    rows: list[dict[str, str]],
    clouds: NDArray[np.float32] | None,
    parts: NDArray[np.uint8] | None,
    manifest: Path,
) -> None:
    """Raise DatasetError if the files of a data set disagree."""
    folder, shape = manifest.parent, (description.samples, description.num_points, 3)
    if len(rows) != description.samples:
        raise DatasetError(f"has {len(rows)} rows", path=manifest, expected=f"{description.samples}")
    if clouds is not None and (clouds.shape != shape or clouds.dtype != np.float32):
        raise DatasetError(
            f"shape {clouds.shape}, {clouds.dtype}", path=folder / CLOUDS_FILE, expected=f"{shape}, float32"
        )
    if parts is not None and (parts.shape != shape[:2] or parts.dtype != np.uint8):
        raise DatasetError(
            f"shape {parts.shape}, {parts.dtype}", path=folder / PARTS_FILE, expected=f"{shape[:2]}, uint8"
        )
    for column in ("sample_id", "state"):
        if rows and column not in rows[0]:
            raise DatasetError("column is missing", path=manifest, field=column)
    name, count = Counter(row["sample_id"] for row in rows).most_common(1)[0] if rows else ("", 0)
    if count > 1:
        raise DatasetError(f"{count} samples are named {name!r}", path=manifest, field="sample_id")
    unknown = sorted({row["state"] for row in rows} - set(LABELS))
    if unknown:
        raise DatasetError(
            f"no state {unknown[0]!r}", path=manifest, field="state", expected=f"one of {', '.join(LABELS)}"
        )
