# SPDX-License-Identifier: Apache-2.0
"""`doorstate predict --bag`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from doorstate.cli.flags import format_flag
from doorstate.cli.predicted_values import Asked, Moment, predicted_values
from doorstate.cli.prediction_output import Output, Rows
from doorstate.errors import CloudReadError, DoorstateError

if TYPE_CHECKING:
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
    asked: Asked,
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
        asked: doors to ask for.
    """
    from doorstate.io.bags import open_bag

    with open_bag(path) as bag:
        chosen = bag.choose(topic)
        predictors = load()
        messages = bag.clouds(chosen, options, camera_info_topic, every)
        clouds = _predict_messages(predictors, messages, asked)
        output.write(clouds, list(predictors), [f"{0:.6f}".rjust(17)], -(-chosen.messages // every))


def _predict_messages(
    predictors: Mapping[str, Predictor], clouds: Iterable[StampedCloud], asked: Asked
) -> Iterator[Rows]:
    """Yield the rows of each message; a bag that is damaged from somewhere on ends with an error row."""
    from doorstate.io.sensor_pose import PosedCloud

    try:
        for stamp_s, _, cloud, pose in clouds:
            row: dict[str, Any] = {"stamp_s": round(stamp_s, 6)}
            try:
                if isinstance(cloud, DoorstateError):
                    raise cloud
                rows = []
                assert pose is not None
                place = None if asked.doors is None else asked.doors.poses.at(stamp_s)
                moment = Moment(f"{stamp_s:.6f}", stamp_s, place)
                for method, predictor in predictors.items():
                    values = predicted_values(predictor, PosedCloud(cloud, pose), asked, moment)
                    rows.append(row | {"method": method} | values)
                yield rows
            except DoorstateError as error:
                yield [row | {"error": error.describe(format_flag, with_path=False)}]
    except CloudReadError as error:
        yield [{"stamp_s": None, "error": error.describe(format_flag)}]
