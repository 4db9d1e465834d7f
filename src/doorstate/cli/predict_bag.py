# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict --bag`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from doorstate.cli.flags import format_flag
from doorstate.cli.prediction_output import Output, Rows
from doorstate.errors import CloudReadError, DoorstateError

if TYPE_CHECKING:
    from doorstate.inference.known import DoorKnown
    from doorstate.inference.predictor import Predictor
    from doorstate.io.bags import StampedCloud
    from doorstate.io.options import ReadOptions


def predict_bag(
    load: Callable[[], Mapping[str, Predictor]],
    path: Path,
    options: ReadOptions,
    topic: str | None,
    camera_info_topic: str | None,
    every: int,
    output: Output,
    door: DoorKnown,
) -> None:
    """Write predictions for every Nth message of a topic.

    Args:
        load: loads the predictors by name; called after the bag was opened, because it takes longer.
        path: bag.
        options: how clouds are read.
        topic: topic to read; None if there is only one.
        camera_info_topic: topic of the camera; None for the usual one.
        every: N.
        output: where the predictions go.
        door: True, or a rough place, where a door is known to be in view.
    """
    from doorstate.io.bags import open_bag

    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        predictors = load()
        messages = bag.clouds(chosen, options, camera_info_topic, every)
        clouds = _predict_messages(predictors, messages, door)
        output.write(clouds, list(predictors), [f"{0:.6f}".rjust(17)], -(-chosen.messages // every))


def _predict_messages(
    predictors: Mapping[str, Predictor], clouds: Iterable[StampedCloud], door: DoorKnown
) -> Iterator[Rows]:
    """Yield the rows of each message; a bag that is damaged from somewhere on ends with an error row."""
    from doorstate.inference.posed import predict_posed
    from doorstate.inference.serialization import prediction_values

    try:
        for stamp_s, _, cloud, pose in clouds:
            row: dict[str, Any] = {"stamp_s": round(stamp_s, 6)}
            try:
                if isinstance(cloud, DoorstateError):
                    raise cloud
                rows = []
                for method, predictor in predictors.items():
                    prediction = predict_posed(predictor, cloud, pose, door)
                    rows.append(row | {"method": method} | prediction_values(prediction, format_flag, pose))
                yield rows
            except DoorstateError as error:
                yield [row | {"error": error.describe(format_flag, with_path=False)}]
    except CloudReadError as error:
        yield [{"stamp_s": None, "error": error.describe(format_flag)}]
