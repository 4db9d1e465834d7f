# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict --bag`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from doorstate.cli.flags import format_flag
from doorstate.cli.prediction_output import open_output
from doorstate.errors import CloudReadError, DoorstateError

if TYPE_CHECKING:
    from doorstate.inference.predictor import Predictor
    from doorstate.io.bags import BagTopic, StampedCloud
    from doorstate.io.options import ReadOptions


def predict_bag(
    load: Callable[[], Predictor],
    path: Path,
    options: ReadOptions,
    topic: str | None,
    camera_info_topic: str | None,
    every: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Write a prediction for every Nth message of a topic.

    Args:
        load: loads the predictor; called after the bag was opened, because it takes longer.
        path: bag.
        options: how clouds are read.
        topic: topic to read; None if there is only one.
        camera_info_topic: topic of the camera; None for the usual one.
        every: N.
        out: file to write; None prints.
        as_json: print JSON lines instead of a table.
    """
    from doorstate.cli.console import progress_bar, stderr
    from doorstate.io.bags import open_bag

    count = failures = 0
    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        predictor = load()
        total = -(-chosen.messages // every)
        messages = bag.clouds(chosen, options, camera_info_topic, every)
        clouds = warn_about_frame(messages, chosen, options)
        with open_output("stamp_s", out, as_json) as write, progress_bar("Predicting") as progress:
            for count, row in enumerate(_rows(predictor, clouds), 1):
                write(row)
                failures += "error" in row
                progress(count, total)
    if failures:
        stderr.print(f"no prediction for {failures} of {count} messages")
        raise typer.Exit(1)


def warn_about_frame(
    messages: Iterable[StampedCloud], topic: BagTopic, options: ReadOptions
) -> Iterator[StampedCloud]:
    """Yield messages, and warn once if their frame is named like an optical one, but read as a body frame."""
    from doorstate.cli.console import stderr
    from doorstate.io.messages import CLOUD, is_optical

    for number, message in enumerate(messages):
        if number == 0 and topic.type == CLOUD and options.frame == "body" and is_optical(message.frame_id):
            warning = f"{topic.name} is in frame {message.frame_id}: is --frame optical missing?"
            stderr.print(warning, soft_wrap=True)
        yield message


def _rows(predictor: Predictor, clouds: Iterable[StampedCloud]) -> Iterator[dict[str, Any]]:
    """Yield a row for each message; a bag that is damaged from somewhere on ends with an error row."""
    from doorstate.inference.serialization import prediction_to_dict

    try:
        for stamp_s, _, cloud in clouds:
            row: dict[str, Any] = {"stamp_s": round(stamp_s, 6)}
            try:
                if isinstance(cloud, DoorstateError):
                    raise cloud
                row |= prediction_to_dict(predictor(cloud), format_flag)
            except DoorstateError as error:
                row["error"] = error.describe(format_flag, with_path=False)
            yield row
    except CloudReadError as error:
        yield {"stamp_s": None, "error": error.describe(format_flag)}
