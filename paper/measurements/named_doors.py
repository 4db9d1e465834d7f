# SPDX-License-Identifier: Apache-2.0
"""Named doors on simulated drives along a corridor and back: right doors, right states, and none taken for another."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from doorstate._jobs import Progress
from doorstate.doors.camera_place import CameraPlace
from doorstate.doors.named_door import DoorPlace, NamedDoor
from doorstate.doors.named_predictor import predict_named
from doorstate.doors.plane_pose import PlanePose
from doorstate.doors.sighting import Sighting
from doorstate.doors.tracker import DoorTracker, TrackedFrame
from doorstate.evaluation.table import Table, count_column, label_column, number_column, text_column
from doorstate.inference.door import Door
from doorstate.inference.predictor import Predictor
from doorstate.io.sensor_pose import camera_pose
from doorstate.simulation.draw.doors import draw_door
from doorstate.simulation.draw.layouts import Layout, PlacedCamera, WallDoor
from doorstate.simulation.draw.openings import draw_openings
from doorstate.simulation.draw.stream import Stream
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.generate import with_sensor
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.row import Row
from doorstate.simulation.scene.box import Pose
from doorstate.simulation.scene.door import Opening
from doorstate.simulation.scene.room import Space
from doorstate.simulation.true_door import OtherDoor, TrueDoor, describe_door
from doorstate.simulation.truth import main_columns, true_doors
from doorstate.simulation.visibility import count_visible, opening_depths_m

from .doorways import VISIBLE_PX
from .words import count_words

POSITION_ERROR_M, YAW_ERROR_DEG = 0.05, 2.0  # of the odometry
DRIVE_S = 30.0
_LENGTH_M, _WIDTH_M = 15.0, 2.6
# Walls and places of the doors; the last is in no list, and beside one that is.
_PLACES = ((0, 3.2), (0, 4.6), (2, 6.0), (0, 8.5), (2, 9.0), (2, 10.4), (0, 9.9))
_LIST_ERROR_M = 0.03
_SWEEP_DEG, _SWEEP_S = 45.0, 4.0
_LEAF_PX = 150
_REACH_M = 4.8  # of the doors of the presets that the weights are trained on
_MOST_BESIDE_DEG = 80.0
_MISTAKEN_M = 0.5


class NamedResult(NamedTuple):
    """One door of the list in one frame."""

    drive: int
    decidable: bool  # enough of door and leaf is in view
    truth: str
    seen: bool
    asked: bool
    state: str | None  # of this frame
    filtered: str | None
    mistaken: bool  # the answer is at the place of another door
    reason: str  # code of the reason why there is no state


class UnknownResult(NamedTuple):
    """Answers of one frame for doors that are not matched, by the true door at their place."""

    listed: int
    unlisted: int
    unlisted_named: int  # the door that is not in the list, under the name of another
    none: int  # at the place of no door


def measure_named_doors(
    predictor: Predictor, sensor: str, drives: int, frames: int, asks: bool, progress: Progress, seed: int
) -> tuple[list[NamedResult], list[UnknownResult]]:
    """Return the results of all doors of the list, and of doors that were not matched, in every frame.

    Args:
        predictor: weights for doorways.
        sensor: name of a sensor model.
        drives: drives, each along another corridor.
        frames: frames of each drive, evenly over 30 s.
        asks: ask for doors that were not found.
        progress: called after each frame.
        seed: seed of corridors and errors.
    """
    named: list[NamedResult] = []
    unknown: list[UnknownResult] = []
    for drive in range(drives):
        corridor = _corridor(seed, drive)
        rng = np.random.default_rng([seed, drive])
        list_ = _door_list(corridor, rng)
        tracker = DoorTracker(list_)
        for number, (row, camera, stamp_s) in enumerate(_rows(corridor, frames, sensor, f"{seed}-{drive}")):
            frame = replay(row)
            truths = _in_order(row, frame, number % len(_PLACES))
            place = CameraPlace(
                PlanePose(
                    camera.x_m + rng.normal(0, POSITION_ERROR_M),
                    camera.y_m + rng.normal(0, POSITION_ERROR_M),
                    math.degrees(camera.yaw_rad) + rng.normal(0, YAW_ERROR_DEG),
                ),
                position_error_m=POSITION_ERROR_M,
                yaw_error_deg=YAW_ERROR_DEG,
            )
            prediction, tracked = predict_named(
                predictor, frame.points, camera_pose("ros"), tracker, place, stamp_s, asks=asks
            )
            half_view_deg = row.camera.hfov_deg / 2
            named += _named_results(drive, tracked.sightings, truths, half_view_deg)
            unknown.append(_unknown_result(prediction.doors, tracked, truths))
            progress(drive * frames + number + 1, drives * frames)
    return named, unknown


def named_doors_table(results: Sequence[NamedResult], unknown: Sequence[UnknownResult], frames: int) -> Table:
    """Return one row for each state and one for all."""
    all_results = pd.DataFrame(results, columns=pd.Index(NamedResult._fields))
    groups = [(state, group) for state, group in all_results.groupby("truth", sort=False)]
    rows = [_line(str(name), group) for name, group in [*groups, ("all", all_results)]]
    sums = {name: sum(getattr(result, name) for result in unknown) for name in UnknownResult._fields}
    return Table.from_frame(
        "Named doors on a drive",
        pd.DataFrame(rows),
        [
            label_column("state"),
            count_column("decidable", "decidable sightings"),
            number_column("answered", "with a state", 3),
            number_column("right", "right, of these", 3),
            number_column("right_all", "right, of all decidable", 3),
            number_column("filtered", "filtered state right, of those with one", 3),
            count_column("as_open", "called open, of all sightings"),
            count_column("mistaken", "taken for another door"),
            text_column("silent", "without a state"),
        ],
        note=f"Six doors of a list and one that is in no list, in a corridor of {_LENGTH_M:g} x {_WIDTH_M:g} m; "
        f"{frames} frames in {DRIVE_S:g} s along it and back, with a camera that turns {_SWEEP_DEG:g} degrees to both "
        f"sides. Errors of the camera's place have a standard deviation of {100 * POSITION_ERROR_M:g} cm and "
        f"{YAW_ERROR_DEG:g} degrees in every frame, those of the list {100 * _LIST_ERROR_M:g} cm. Every door has one "
        "state on the way there and another draw on the way back; kinds as in the preset `corridor` without full "
        f"glass. A sighting is decidable if {VISIBLE_PX} pixels see leaf, frame or opening and {_LEAF_PX} of them the "
        f"leaf, the middle of the opening is in view and at most {_REACH_M:g} m away, and the camera at most "
        f"{_MOST_BESIDE_DEG:g} degrees beside its normal. Answers without a name: {sums['listed']} at doors of the "
        f"list, {sums['unlisted']} at the other door, {sums['none']} at no door. The door in no list got the name of "
        f"another {sums['unlisted_named']} times.",
    )


def _line(state: str, results: pd.DataFrame) -> dict[str, object]:
    decidable = results[results["decidable"]]
    answered = decidable[decidable["state"].notna()]
    filtered = decidable[decidable["filtered"].notna()]
    return {
        "state": state,
        "decidable": len(decidable),
        "answered": len(answered) / max(1, len(decidable)),
        "right": (answered["state"] == answered["truth"]).mean(),
        "right_all": (answered["state"] == answered["truth"]).sum() / max(1, len(decidable)),
        "filtered": (filtered["filtered"] == filtered["truth"]).mean(),
        "as_open": int(((results["state"] == "open") & (results["truth"] != "open")).sum()),
        "mistaken": int(results["mistaken"].sum()),
        "silent": count_words(decidable.loc[decidable["state"].isna(), "reason"]),
    }


class _Corridor(NamedTuple):
    layout: Layout
    openings: tuple[tuple[Opening, Opening], ...]  # of each door, there and back


def _corridor(seed: int, drive: int) -> _Corridor:
    stream = Stream(seed, drive, "named-doors")
    layout = Layout(_LENGTH_M, _WIDTH_M, (True, True, True, True))
    walls_m = [(stream.uniform(0.1, 0.25), 2.6) for _ in range(4)]
    doors: list[WallDoor] = []
    openings = []
    for wall, x_m in _PLACES:
        door = draw_door(stream, walls_m[wall])
        while door.kind == "full_glass" or door.opening_width_m > 1.05:
            door = draw_door(stream, walls_m[wall])
        door = door.model_copy(update={"wall_half_length_m": _LENGTH_M})
        along_m = _LENGTH_M - x_m if wall == 2 else x_m
        behind = Space(depth_m=4.0) if not any(other.wall == wall for other in doors) else Space()
        doors.append(WallDoor(wall, along_m, door, behind))
        drawn = draw_openings(stream, door, 100.0)
        openings.append((drawn[stream.integer(0, 2)], drawn[stream.integer(0, 2)]))
    return _Corridor(layout._replace(doors=tuple(doors)), tuple(openings))


def _door_list(corridor: _Corridor, rng: np.random.Generator) -> list[NamedDoor]:
    """Return the list of all doors but the last."""
    list_ = []
    for number, wall_door in enumerate(corridor.layout.doors[:-1]):
        frame = corridor.layout.door_frame(number)
        x_m, y_m = (value + rng.normal(0, _LIST_ERROR_M) for value in (frame.x_m, frame.y_m))
        place = DoorPlace(x_m=x_m, y_m=y_m, yaw_deg=math.degrees(frame.yaw_rad))
        door = wall_door.door
        list_.append(NamedDoor(id=f"door-{number}", pose=place, width_m=door.opening_width_m))
    return list_


def _rows(corridor: _Corridor, frames: int, sensor: str, name: str) -> Iterator[tuple[Row, Pose, float]]:
    """Yield a row for each frame, with the camera's pose in the corridor and the time; main doors take turns."""
    for number in range(frames):
        stamp_s = DRIVE_S * number / frames
        share = 2 * number / frames
        is_back = share >= 1
        x_m = 0.8 + (_LENGTH_M - 1.6) * (2 - share if is_back else share)
        turn_deg = _SWEEP_DEG * math.sin(2 * math.pi * stamp_s / _SWEEP_S)
        pose = Pose(x_m, _WIDTH_M / 2, math.radians(turn_deg + (180 if is_back else 0)))
        yield _row(corridor, number % len(_PLACES), is_back, pose, sensor, f"{name}-{number}"), pose, stamp_s


def _row(corridor: _Corridor, main: int, is_back: bool, pose: Pose, sensor: str, name: str) -> Row:
    layout = corridor.layout
    camera = PlacedCamera(pose, 1.0, 0.0, 0.0)
    scene, view = layout.scene(main), camera.viewpoint(layout.door_frame(main))
    assert scene.door is not None
    openings = [both[is_back] for both in corridor.openings]
    others = [number for number in range(len(layout.doors)) if number != main]
    seen = [
        describe_door(
            layout.doors[number].door, openings[number], layout.door_frame(number).inverse().after(pose), 1.0
        )
        for number in (main, *others)
    ]
    columns = main_columns(seen[0])
    row = Row(
        **columns,  # type: ignore[arg-type]
        sample_id=name,
        pose_id=name,
        scene_kind="door",
        seed=1,
        camera=PRESETS["corridor"].camera,
        scene=scene,
        other_doors=tuple(
            OtherDoor(opening=openings[number], truth=truth)
            for number, truth in zip(others, seen[1:], strict=True)
        ),
        **{name: getattr(view, name) for name in view._fields if name != "heading_rad"},
    )
    return with_sensor(row, sensor)


def _in_order(row: Row, frame: Frame, main: int) -> list[TrueDoor]:
    """Return the doors in the order of the corridor, with their visible pixels."""
    openings_m = opening_depths_m(row.scene, row.camera_pose(), row.camera.intrinsics())
    doors = [
        door.model_copy(update={"visible_px": count_visible(frame.full, frame.cut, numbers, opening_m)})
        for door, numbers, opening_m in zip(
            true_doors(row), row.box_groups().doors(), openings_m, strict=True
        )
    ]
    own, others = doors[0], doors[1:]
    return [*others[:main], own, *others[main:]]


def _is_decidable(door: TrueDoor, half_view_deg: float) -> bool:
    bearing_deg = math.degrees(math.atan2(door.y_m, door.x_m))
    beside_deg = abs(math.remainder(door.yaw_deg - 90 - bearing_deg, 360))
    seen = door.visible_px
    is_seen = seen.total >= VISIBLE_PX and seen.leaf >= _LEAF_PX and beside_deg <= _MOST_BESIDE_DEG
    is_ahead = math.hypot(door.x_m, door.y_m) <= _REACH_M and abs(bearing_deg) <= half_view_deg
    return is_seen and is_ahead


def _named_results(
    drive: int, sightings: Sequence[Sighting], truths: Sequence[TrueDoor], half_view_deg: float
) -> Iterator[NamedResult]:
    for number, sighting in enumerate(sightings):
        truth = truths[number]
        filtered = None if sighting.filtered is None else sighting.filtered.state
        mistaken = sighting.door is not None and _nearest(sighting.door, truths) not in (number, None)
        yield NamedResult(
            drive,
            _is_decidable(truth, half_view_deg),
            str(truth.state),
            sighting.is_seen,
            sighting.asked,
            None if sighting.state is None else str(sighting.state),
            None if filtered is None else str(filtered),
            mistaken,
            _reason(sighting),
        )


def _reason(sighting: Sighting) -> str:
    abstention = None if sighting.door is None else sighting.door.abstention
    return sighting.code or ("" if abstention is None else abstention.code)


def _nearest(door: Door, truths: Sequence[TrueDoor]) -> int | None:
    """Return the number of the true door at the place of an answer."""
    gaps_m = [math.hypot(door.x_m - truth.x_m, door.y_m - truth.y_m) for truth in truths]
    nearest = int(np.argmin(gaps_m))
    return nearest if gaps_m[nearest] <= _MISTAKEN_M else None


def _unknown_result(
    doors: Sequence[Door], tracked: TrackedFrame, truths: Sequence[TrueDoor]
) -> UnknownResult:
    last = len(truths) - 1
    at = [(_nearest(door, truths), name) for door, name in zip(doors, tracked.names, strict=True)]
    return UnknownResult(
        sum(name is None and number is not None and number != last for number, name in at),
        sum(name is None and number == last for number, name in at),
        sum(name is not None and number == last for number, name in at),
        sum(name is None and number is None for number, name in at),
    )
