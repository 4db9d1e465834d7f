# SPDX-License-Identifier: Apache-2.0
"""Labelled recordings for evaluation: class folders, a folder with an `index.csv`, or a published layout."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from doorstate.dataset.class_folders import file_row, label_of_folder, nearest_label
from doorstate.dataset.frame_index import read_index
from doorstate.dataset.layouts import Layout, find_layout
from doorstate.doorways.doorway import Doorway
from doorstate.errors import DatasetError, unknown_name
from doorstate.io.find import INDEX_FILE, find_clouds
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.io.readers import read_posed_cloud
from doorstate.io.sensor_pose import PosedCloud, camera_pose


@dataclass(frozen=True)
class LabelledFrame:
    """A recorded cloud, or one door in it, with its label and its further columns."""

    file: str  # below the folder
    label: str  # a state, `no_door`, or any other text of the index
    columns: Mapping[str, str]  # further columns as written
    folder: Path
    read: Callable[[], PosedCloud]
    doorway: Doorway | None = None  # place of the door that is labelled
    number: int = 1  # among the lines of the file

    @property
    def name(self) -> str:
        """The file, with a number from its second line on."""
        return self.file if self.number == 1 else f"{self.file}#{self.number}"


def labelled_frames(
    folder: Path, options: ReadOptions = DEFAULT_OPTIONS, layout: str | None = None
) -> list[LabelledFrame]:
    """Find the labelled clouds of a folder without reading them.

    An `index.csv` (`frame_index`) takes precedence over the names of sub-folders.

    Args:
        folder: folder with an index, or with sub-folders named after states.
        options: read options of files whose camera and units neither they nor the index state.
        layout: name in `dataset.layouts`, in place of index and sub-folders.

    Raises:
        CloudReadError: no cloud at all.
        ConfigError: no such layout.
        DatasetError: no label at all, or a line of the index is invalid.
        CameraError: the index holds impossible intrinsics or units.
    """
    if layout is not None:
        published = find_layout(layout)
        rows = published.rows(folder)
        return [
            _frame(folder, row, partial(_read_published, published, folder / row["file"], options))
            for row in rows
        ]
    if not folder.is_dir():
        raise DatasetError("is not a folder", path=folder)
    if (folder / INDEX_FILE).is_file():
        return _indexed_frames(folder, options)
    labels = {path: nearest_label(folder, path, label_of_folder) for path in find_clouds([folder])}
    rows = [file_row(folder, path, label) for path, label in labels.items() if label is not None]
    if not rows:
        raise DatasetError(
            f"has no {INDEX_FILE} and no clouds in folders named after states",
            path=folder,
            expected="folders such as closed, semi-open, open, no-door",
        )
    return [_frame(folder, row, partial(read_posed_cloud, folder / row["file"], options)) for row in rows]


def _indexed_frames(folder: Path, options: ReadOptions) -> list[LabelledFrame]:
    lines: Counter[str] = Counter()
    frames = []
    for row, row_options, doorway in read_index(folder, options):
        lines[row["file"]] += 1
        frame = _frame(folder, row, partial(read_posed_cloud, folder / row["file"], row_options))
        frames.append(replace(frame, doorway=doorway, number=lines[row["file"]]))
    return frames


def _read_published(layout: Layout, path: Path, options: ReadOptions) -> PosedCloud:
    return PosedCloud(
        layout.read(path, options), camera_pose("ros", tilt_from="assumed")
    )  # published images do not tell their tilt


def check_column(frames: Sequence[LabelledFrame], column: str) -> None:
    """Raise ConfigError unless a frame has this column."""
    names = list(dict.fromkeys(name for frame in frames for name in frame.columns))
    if column not in names:
        raise unknown_name("column", column, names)


def _frame(folder: Path, row: Mapping[str, str], read: Callable[[], PosedCloud]) -> LabelledFrame:
    columns = {name: value for name, value in row.items() if name not in ("sample_id", "file", "state")}
    return LabelledFrame(row["file"], row["state"], columns, folder, read)
