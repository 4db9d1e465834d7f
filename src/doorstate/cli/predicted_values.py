# SPDX-License-Identifier: Apache-2.0
"""Values of the row for one cloud: its prediction, the names of its doors, and its plan as a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from doorstate.cli.flags import format_flag

if TYPE_CHECKING:
    from doorstate.cli.named_options import NamedDoors
    from doorstate.doors.camera_place import CameraPlace, MissingPlace
    from doorstate.inference.known import DoorKnown
    from doorstate.inference.prediction import Prediction
    from doorstate.inference.predictor import Predictor
    from doorstate.io.sensor_pose import PosedCloud
    from doorstate.types import Points


class Asked(NamedTuple):
    """Doors that a user asks for, and the file of the plan."""

    door: DoorKnown = False  # True, or a rough place, where a door is known to be in view
    doors: NamedDoors | None = None  # of a list
    plan: Path | None = None


class Moment(NamedTuple):
    """Name of a cloud, its time, and the pose of its camera in a map, where they are known."""

    frame: str
    stamp_s: float | None = None
    place: CameraPlace | MissingPlace | None = None


def predicted_values(
    predictor: Predictor, cloud: PosedCloud, asked: Asked, moment: Moment, *, needs_points: bool = False
) -> dict[str, Any]:
    """Return `prediction_values` of a cloud, with `named_doors` where there is a list; write its plan.

    Raises:
        DoorstateError: the cloud cannot be used, or a file cannot be written.
    """
    from doorstate.doors.sighting import names_of_doors
    from doorstate.inference.posed import predict_posed
    from doorstate.inference.serialization import prediction_values, require_points

    names: tuple[str | None, ...] = ()
    extra: dict[str, Any] = {}
    if asked.doors is None or moment.place is None:
        prediction = predict_posed(predictor, *cloud, asked.door)
    else:
        prediction, tracked = asked.doors.predict(
            predictor, cloud, moment.frame, moment.stamp_s, moment.place
        )
        names = tracked.names
        has_time = moment.stamp_s is not None
        extra["named_doors"] = [
            sighting.to_dict(format_flag, has_time=has_time) for sighting in tracked.sightings
        ]
    if needs_points:
        require_points(prediction)
    if asked.plan is not None:
        _write_plan(asked.plan, cloud.points, prediction, names, moment.frame)
    values = prediction_values(prediction, format_flag, cloud.pose)
    return (names_of_doors(values, names) if asked.doors is not None else values) | extra


def _write_plan(
    path: Path, points: Points, prediction: Prediction, names: tuple[str | None, ...], title: str
) -> None:
    from doorstate._files import write_text
    from doorstate.clouds.floor import lowest_z_m
    from doorstate.doors.sighting import View
    from doorstate.doorways.finder import thinned
    from doorstate.pages.plan import make_plan, plan_walls
    from doorstate.pages.plan_svg import plan_svg

    sample = thinned(points)
    level = sample if prediction.tilt is None else prediction.tilt.to_level(sample)
    floor_z_m = next((door.floor_z_m for door in prediction.doors if door.floor_z_m is not None), None)
    if floor_z_m is None and len(level):
        floor_z_m = lowest_z_m(level)
    view = View.of(level)
    plan = make_plan(prediction, names, plan_walls(level, floor_z_m or 0.0), (view.right_deg, view.left_deg))
    write_text(path, plan_svg(plan, title))
