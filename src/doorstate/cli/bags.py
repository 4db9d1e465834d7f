# SPDX-License-Identifier: Apache-2.0
"""`predict --bag`: an answer for every message of a recording."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from doorstate.cli.predictions import table_cells
from doorstate.deployment.answers import described
from doorstate.errors import CloudReadError, DoorstateError

if TYPE_CHECKING:
    from doorstate.clouds.bags import BagTopic, StampedCloud
    from doorstate.clouds.io import ReadOptions

Write = Callable[[dict[str, Any]], None]


def predict_bag(
    load: Callable[[], Any],
    path: Path,
    options: ReadOptions,
    topic: str | None,
    camera_info_topic: str | None,
    every: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Answer the messages of one topic into a file, or onto standard output as a table or JSON lines."""
    from doorstate.clouds.bags import open_bag
    from doorstate.console import err, progress_bar

    count = failures = 0
    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        predictor = load()  # takes a second: a recording that cannot be used is told before
        total = -(-chosen.messages // every)
        clouds = bag.clouds(chosen, options, camera_info_topic, every)
        with _destination(out, as_json) as write, progress_bar("Predicting") as progress:
            for answer, frame_id in _answers(predictor, clouds):
                if count == 0:
                    hint_at_frame(chosen, options, frame_id)
                write(answer)
                count += 1
                failures += "error" in answer
                progress(count, total)
    if failures:
        err.print(f"{failures} of {count} messages could not be answered")
        raise typer.Exit(1)


def hint_at_frame(topic: BagTopic, options: ReadOptions, frame_id: str) -> None:
    """Say so where clouds that are taken as they are come in an optical frame."""
    from doorstate.clouds.messages import CLOUD, is_optical
    from doorstate.console import err

    if topic.type == CLOUD and options.frame == "body" and is_optical(frame_id):
        hint = f"{topic.name} is in the frame {frame_id}: is --frame optical missing?"
        err.print(hint, soft_wrap=True)


def _answers(predictor: Any, clouds: Iterable[StampedCloud]) -> Iterator[tuple[dict[str, Any], str]]:
    """Answers and frames; a bag that breaks off keeps its answers so far, and a last one with the error."""
    try:
        for stamp_s, frame_id, cloud in clouds:
            answer: dict[str, Any] = {"stamp_s": round(stamp_s, 6)}
            try:
                if isinstance(cloud, DoorstateError):
                    raise cloud
                answer |= described(predictor(cloud))
            except DoorstateError as error:
                answer["error"] = str(error)
            yield answer, frame_id
    except CloudReadError as error:
        yield {"stamp_s": None, "error": str(error)}, ""


@contextmanager
def _destination(out: Path | None, as_json: bool) -> Iterator[Write]:
    from doorstate.files import atomic_path

    if out is None:
        with _printed_lines() if as_json else _printed_table() as write:
            yield write
        return
    with atomic_path(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        yield WRITERS[out.suffix](stream)


@contextmanager
def _printed_lines() -> Iterator[Write]:
    yield lambda answer: print(json.dumps(answer, ensure_ascii=False), flush=True)  # noqa: T201


@contextmanager
def _printed_table() -> Iterator[Write]:
    from doorstate.console import err, print_table
    from doorstate.types import STATES

    rows: list[list[str]] = []

    def write(answer: dict[str, Any]) -> None:
        stamp = "-" if answer["stamp_s"] is None else f"{answer['stamp_s']:.6f}"
        if "error" in answer:
            err.print(f"{stamp}: {answer['error']}", style="red", soft_wrap=True)
        else:
            rows.append([stamp, *table_cells(answer)])

    yield write
    if rows:
        print_table("", ["stamp", "state", *STATES, "points", "ms"], rows)


def _json_lines(stream: Any) -> Write:
    return lambda answer: stream.write(json.dumps(answer, ensure_ascii=False) + "\n")


def _csv_rows(stream: Any) -> Write:
    from doorstate.deployment.answers import FURTHER
    from doorstate.types import STATES

    columns = ["stamp_s", "state", *STATES, "points", "milliseconds", *FURTHER, "reason", "error"]
    rows = csv.DictWriter(stream, columns, lineterminator="\n")
    rows.writeheader()

    def write(answer: dict[str, Any]) -> None:
        flat = answer | answer.get("probabilities", {})
        rows.writerow({column: flat.get(column) for column in columns})

    return write


WRITERS: dict[str, Callable[[Any], Write]] = {".csv": _csv_rows, ".jsonl": _json_lines}
"""By the ending of the file."""
