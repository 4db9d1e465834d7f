# SPDX-License-Identifier: Apache-2.0
"""Where `predict` puts its answers, of files and of messages: a table, JSON lines, or a file."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

Write = Callable[[dict[str, Any]], None]


@contextmanager
def destination(key: str, out: Path | None, as_json: bool) -> Iterator[Write]:
    """Call with described answers, each with an `error` if there is none, and under `key` what it is of.

    The file appears when all are written, and not at all if something fails.

    Args:
        key: `file`, or `stamp_s` of messages.
        out: a file to write, by its ending of `WRITERS`; otherwise standard output.
        as_json: print lines of JSON and no table.
    """
    from doorstate._files import atomic_path

    if out is None:
        with _printed_lines() if as_json else _printed_table(key) as write:
            yield write
        return
    with atomic_path(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        yield WRITERS[out.suffix](stream, key)


@contextmanager
def _printed_lines() -> Iterator[Write]:
    yield lambda answer: print(json.dumps(answer, ensure_ascii=False), flush=True)  # noqa: T201


@contextmanager
def _printed_table(key: str) -> Iterator[Write]:
    from doorstate.cli.console import err, print_table
    from doorstate.types import STATES

    rows: list[list[str]] = []

    def write(answer: dict[str, Any]) -> None:
        what = _shown(answer[key])
        if "error" in answer:
            err.print(f"{what}: {answer['error']}", style="red", soft_wrap=True)
        else:
            rows.append([what, *_cells(answer)])

    yield write
    if rows:
        print_table("", [key.removesuffix("_s"), "state", *STATES, "points", "ms"], rows)


def _shown(value: str | float | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.6f}"


def _cells(answer: dict[str, Any]) -> list[str]:
    said = answer["state"] or f"none: {answer['reason']}"
    odds = [f"{probability:.3f}" for probability in answer["probabilities"].values()]
    return [said, *odds, str(answer["points"]), f"{answer['milliseconds']:.0f}"]


def _json_lines(stream: Any, key: str) -> Write:
    return lambda answer: stream.write(json.dumps(answer, ensure_ascii=False) + "\n")


def _csv_rows(stream: Any, key: str) -> Write:
    from doorstate.inference.serialization import FURTHER
    from doorstate.types import STATES

    columns = [key, "state", *STATES, "points", "milliseconds", *FURTHER, "reason", "error"]
    rows = csv.DictWriter(stream, columns, lineterminator="\n")
    rows.writeheader()

    def write(answer: dict[str, Any]) -> None:
        flat = answer | answer.get("probabilities", {})
        rows.writerow({column: flat.get(column) for column in columns})

    return write


WRITERS: dict[str, Callable[[Any, str], Write]] = {".csv": _csv_rows, ".jsonl": _json_lines}
"""By the ending of the file."""
