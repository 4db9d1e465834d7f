# SPDX-License-Identifier: Apache-2.0
"""Labels of frames in an `index.csv`, written after each change and read again before it.

The file is the only copy: a process that is killed loses nothing, and lines that another program has written meanwhile
stay. Columns and lines that are not changed keep their values.
"""

from __future__ import annotations

import posixpath
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from doorstate._files import read_csv, write_csv
from doorstate._paths import check_encoding, csv_name
from doorstate.dataset.class_folders import file_row, label_of_folder, nearest_label
from doorstate.dataset.frame_index import (
    DOOR_COLUMN,
    MOMENT_COLUMN,
    PLACE_COLUMNS,
    doorway_of_line,
)
from doorstate.doorways.doorway import Doorway
from doorstate.errors import DatasetError
from doorstate.io.find import INDEX_FILE

_DIGITS = 4  # of metres and degrees
_OWN = ("file", "state", DOOR_COLUMN, MOMENT_COLUMN, *PLACE_COLUMNS)


@dataclass(frozen=True)
class DoorLabel:
    """Label of one door in a frame, or without a place of the whole frame."""

    state: str  # a state, `no_door`, `unknown`, or any other text of the index
    door: str = ""  # name of the door
    doorway: Doorway | None = None


Labels = tuple[DoorLabel, ...]
"""Labels of a frame; none if it is not labelled."""
Lines = list[dict[str, str]]
"""Lines of an index."""


class LabelIndex:
    """`index.csv` of a folder that is being labelled.

    Without an index, the first line is written together with those of files in sub-folders named after states, which
    the index would hide otherwise.

    Args:
        folder: folder of the index; need not exist.
        files: names of the files of the folder, relative to it.
    """

    def __init__(self, folder: Path, files: Sequence[str] = ()) -> None:
        self.path = folder / INDEX_FILE
        self._of_folders: Lines = []
        for file in files if not self.path.is_file() else ():
            if (label := nearest_label(folder, folder / file, label_of_folder)) is not None:
                row = file_row(folder, folder / file, label)
                self._of_folders.append({"file": row["file"], "state": row["state"]})

    def rows(self) -> Lines:
        """Return the lines.

        Raises:
            DatasetError: the index is damaged, or has no columns `file` and `state`.
        """
        if not self.path.is_file():
            return self._of_folders
        rows = read_csv(self.path)
        for column in ("file", "state"):
            if rows and column not in rows[0]:
                raise DatasetError(f"has no column {column!r}", path=self.path, field=column)
        return rows

    def labels(self) -> dict[str, Labels]:
        """Return the labels of each labelled file.

        Raises:
            DatasetError: as for `rows`, or a place of a door is damaged.
        """
        labels: dict[str, Labels] = {}
        for number, row in enumerate(self.rows(), start=2):
            if state := row["state"].strip():
                doorway = doorway_of_line(row, self.path, number)
                label = DoorLabel(label_of_folder(state) or state, row.get(DOOR_COLUMN, ""), doorway)
                file = _normalized(row["file"])
                labels[file] = (*labels.get(file, ()), label)
        return labels

    def column(self, name: str) -> dict[str, str]:
        """Return the values of a column, of the first line of each file."""
        values: dict[str, str] = {}
        for row in self.rows():
            values.setdefault(_normalized(row["file"]), row.get(name, ""))
        return values

    def lines(self, file: str) -> Lines:
        """Return the lines of a file as they are."""
        return [row for row in self.rows() if _normalized(row["file"]) == file]

    def replace(
        self, file: str, labels: Labels, moment: str = "", columns: Mapping[str, str] | None = None
    ) -> None:
        """Write the labels of a file in place of those it has, whole or not at all.

        Args:
            file: name of the file in the folder of the index.
            labels: its labels, at least one.
            moment: name of the still view.
            columns: further columns; values that the index has are kept.

        Raises:
            CloudReadError: the name is not in UTF-8.
            DatasetError: the index cannot be read any more.
            OutputError: it cannot be written.
        """
        check_encoding(file)
        old = next(iter(self.lines(file)), {"file": csv_name(file)})
        kept = {name: value for name, value in old.items() if name not in _OWN}
        further = {name: kept.get(name) or value for name, value in (columns or {}).items()}
        self.restore(
            file,
            [
                {"file": old["file"], "state": label.state, **_door_columns(label, moment), **kept, **further}
                for label in labels
            ],
        )

    def restore(self, file: str, lines: Lines) -> None:
        """Write lines in place of those of a file; without any line left, the index is removed. Errors: `replace`."""
        rows = self.rows()
        places = [place for place, row in enumerate(rows) if _normalized(row["file"]) == file]
        at = places[0] if places else len(rows)
        others = [row for place, row in enumerate(rows) if place not in places]
        if written := [*others[:at], *lines, *others[at:]]:
            write_csv(self.path, written)
        else:
            self.path.unlink(missing_ok=True)


def _door_columns(label: DoorLabel, moment: str) -> dict[str, str]:
    doorway = label.doorway
    place = {
        column: "" if doorway is None else str(round(getattr(doorway, field), _DIGITS))
        for column, field in PLACE_COLUMNS.items()
    }
    return {DOOR_COLUMN: label.door, MOMENT_COLUMN: moment, **place}


def _normalized(file: str) -> str:
    return posixpath.normpath(file)
