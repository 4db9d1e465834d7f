# SPDX-License-Identifier: Apache-2.0
"""Output of `doorstate predict`: a table, JSON lines, or a CSV or JSONL file."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

Write = Callable[[dict[str, Any]], None]
"""Writes one row: a prediction or an `error`, and the name or time stamp of its cloud."""


@contextmanager
def open_output(key: str, out: Path | None, as_json: bool) -> Iterator[Write]:
    """Yield a function that writes rows.

    A file is written whole or not at all.

    Args:
        key: field that identifies a row: `file`, or `stamp_s` of messages.
        out: file to write, with a suffix of `WRITERS`; None prints on standard output.
        as_json: print JSON lines instead of a table.
    """
    from doorstate._files import atomic_path

    if out is not None:
        with atomic_path(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            yield WRITERS[out.suffix](stream, key)
    elif as_json:
        yield lambda row: print(json.dumps(row, ensure_ascii=False), flush=True)  # noqa: T201
    else:
        with _printed_table(key) as write:
            yield write


@contextmanager
def _printed_table(key: str) -> Iterator[Write]:
    from doorstate.cli.console import print_table, stderr
    from doorstate.types import STATES

    rows: list[list[str]] = []

    def write(row: dict[str, Any]) -> None:
        name = _format_key(row[key])
        if "error" in row:
            stderr.print(f"{name}: {row['error']}", style="red", soft_wrap=True)
        else:
            rows.append([name, *_cells(row)])

    yield write
    if rows:
        print_table("", [key.removesuffix("_s"), "state", *STATES, "points", "ms"], rows)


def _format_key(value: str | float | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.6f}"


def _cells(row: dict[str, Any]) -> list[str]:
    state = row["state"] or f"none: {row['reason']}"
    probabilities = [f"{probability:.3f}" for probability in row["probabilities"].values()]
    return [state, *probabilities, str(row["points"]), f"{row['milliseconds']:.0f}"]


def _json_writer(stream: TextIO, key: str) -> Write:
    def write(row: dict[str, Any]) -> None:
        stream.write(json.dumps(row, ensure_ascii=False) + "\n")

    return write


def _csv_writer(stream: TextIO, key: str) -> Write:
    from doorstate.inference.serialization import OPTIONAL_FIELDS
    from doorstate.types import STATES

    columns = [key, "state", *STATES, "points", "milliseconds", *OPTIONAL_FIELDS, "reason", "error"]
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()

    def write(row: dict[str, Any]) -> None:
        flat = row | row.get("probabilities", {})
        writer.writerow({column: flat.get(column) for column in columns})

    return write


WRITERS: dict[str, Callable[[TextIO, str], Write]] = {".csv": _csv_writer, ".jsonl": _json_writer}
"""Writers by the suffix of the file."""
