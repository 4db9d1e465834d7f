# SPDX-License-Identifier: Apache-2.0
"""`predict --bag`: an answer for every message of a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from doorstate.cli.output import destination
from doorstate.errors import CloudReadError, DoorstateError
from doorstate.inference.serialization import described

if TYPE_CHECKING:
    from doorstate.io.bags import BagTopic, StampedCloud
    from doorstate.io.readers import ReadOptions


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
    from doorstate.cli.console import err, progress_bar
    from doorstate.io.bags import open_bag

    count = failures = 0
    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        predictor = load()  # takes a second: a recording that cannot be used is told before
        total = -(-chosen.messages // every)
        clouds = bag.clouds(chosen, options, camera_info_topic, every)
        with destination("stamp_s", out, as_json) as write, progress_bar("Predicting") as progress:
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
    from doorstate.cli.console import err
    from doorstate.io.messages import CLOUD, is_optical

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
