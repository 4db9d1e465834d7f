# SPDX-License-Identifier: Apache-2.0
"""Output of `doorstate predict`: a table, JSON lines, or a CSV or JSONL file."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import typer

from doorstate._paths import csv_name
from doorstate.cli.console import json_line, print_json

Rows = list[dict[str, Any]]
"""`prediction_values` of all methods for one cloud, or one row with its `error`; each names its cloud."""
Write = Callable[[dict[str, Any]], None]


class Output(NamedTuple):
    """Destination of predictions, and the names of their clouds."""

    key: str  # field that names a cloud: `file`, or `stamp_s` of messages
    noun: str
    path: Path | None = None  # file to write
    as_json: bool = False
    draws: bool = False  # doors from above below each row of the table
    is_named: bool = False  # doors have names

    @property
    def is_table(self) -> bool:
        """True if a table is printed."""
        return self.path is None and not self.as_json

    def write(
        self,
        clouds: Iterable[Rows],
        methods: Sequence[str],
        names: Sequence[str] = (),
        total: int = 0,
    ) -> None:
        """Write all rows and a summary; exit with code 1 if a cloud has no prediction.

        Args:
            clouds: rows of each cloud.
            methods: names of the methods.
            names: names of the clouds, as far as they are known.
            total: number of clouds, for the progress.
        """
        from doorstate.cli.console import stdout
        from doorstate.cli.prediction_summary import PredictionSummary
        from doorstate.cli.progress import progress_bar

        summary = PredictionSummary(self.noun)
        hidden = self.is_table and stdout.is_terminal  # the rows show how far it is
        with self._open(names, methods) as write, progress_bar("Predicting", hidden=hidden) as progress:
            for done, rows in enumerate(clouds, 1):
                for row in rows:
                    write(row)
                summary.add(_format_key(rows[0][self.key]), rows)
                progress(done, total)
        if self.as_json:
            summary.print_failures()
        else:
            summary.print_errors()
            if self.path or summary.clouds > 1:
                summary.print_counts(f"; written to {self.path}" if self.path else "")
        if summary.failures:
            raise typer.Exit(1)

    @contextmanager
    def _open(self, names: Sequence[str], methods: Sequence[str]) -> Iterator[Write]:
        """Yield a function that writes a row; a file is written whole or not at all."""
        from doorstate._files import atomic_path
        from doorstate.cli.prediction_table import PredictionTable
        from doorstate.inference.serialization import rounded

        if self.path is not None:
            with (
                atomic_path(self.path) as temporary,
                temporary.open("w", newline="", encoding="utf-8") as stream,
            ):
                write_rounded = WRITERS[self.path.suffix](stream, self.key, self.is_named)
                yield lambda row: write_rounded(rounded(row))
        elif self.as_json:
            yield lambda row: print_json(rounded(row))
        else:
            table = PredictionTable(self.key.removesuffix("_s"), names, methods, draws=self.draws)

            def write(row: dict[str, Any]) -> None:
                if "error" not in row:
                    table.add(_format_key(row[self.key]), row)

            yield write


def _format_key(value: str | float | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.6f}"


def _json_writer(stream: TextIO, key: str, is_named: bool = False) -> Write:
    def write(row: dict[str, Any]) -> None:
        stream.write(json_line(row) + "\n")

    return write


def _csv_writer(stream: TextIO, key: str, is_named: bool = False) -> Write:
    from doorstate.inference.serialization import DOOR_FIELDS, OPTIONAL_FIELDS
    from doorstate.types import STATES

    common = [key, "method", "points", "milliseconds"]
    of_doors = [name for name in DOOR_FIELDS if name not in OPTIONAL_FIELDS and name not in _PLACE]
    columns = [
        key,
        "method",
        "door",
        *(["name"] if is_named else []),
        "state",
        *STATES,
        "points",
        "milliseconds",
    ]
    columns += [*OPTIONAL_FIELDS, *of_doors, "reason", "error"]
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()

    def write(row: dict[str, Any]) -> None:
        for one in _by_door(row, common):
            flat = one | (one.get("probabilities") or {})
            if isinstance(flat[key], str):
                flat[key] = csv_name(flat[key])
            writer.writerow({column: flat.get(column) for column in columns})

    return write


def _by_door(row: dict[str, Any], columns: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Yield a row for each door, numbered from the one that the prediction is about; one row where there are none."""
    doors = row.get("doors")
    if not doors:
        yield row
        return
    common = {column: row[column] for column in columns if column in row}
    for number, door in enumerate(doors, 1):
        yield common | {_PLACE.get(name, name): value for name, value in door.items()} | {"door": number}


# Columns of a door's place, which the fields of a single door have as well.
_PLACE = {"x_m": "door_x_m", "y_m": "door_y_m", "yaw_deg": "door_yaw_deg", "width_m": "opening_width_m"}


WRITERS: dict[str, Callable[..., Write]] = {".csv": _csv_writer, ".jsonl": _json_writer}
"""Writers by the suffix of the file; each takes a stream, the field that names a cloud, and if doors have names."""
