# SPDX-License-Identifier: Apache-2.0
"""Crops of simulated frames around the doorways that the finder proposes, and their lines of a manifest.

A crop has the line of its frame, with the door in the crop's frame. Columns that differ from those of the frame are
kept there as `frame.NAME`, so that the frame can be rendered again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal

import numpy as np

from doorstate._models import FrozenModel
from doorstate.clouds.floor import find_floor_z_m
from doorstate.clouds.outliers import remove_outliers
from doorstate.doorways.doorway import Doorway, gap
from doorstate.doorways.finder import find_doorways
from doorstate.simulation.manifest import flatten, unflatten
from doorstate.simulation.noise.streams import sample_seed, stage_rng
from doorstate.simulation.row import Row
from doorstate.simulation.truth import DOOR_COLUMNS, TrueDoor, main_columns, true_doors
from doorstate.types import NO_DOOR, Points

Columns = Mapping[str, str]
FINDER_SCORE: Final = "finder_score"  # column
ADDED: Final = "added"  # in the column `candidate`: a door that the finder missed
_FRAME = "frame."
HIT_M, HIT_DEG = 0.35, 20.0  # a candidate this near a door is one of it
_ADDED_ERRORS = (0.08, 0.05, 3.0)  # of added doors: metres along and across the wall, degrees
_MOST_SIGMAS = 2.0
_VISIBLE_SHARE = 0.005  # of the image: leaf, frame or opening of a door that can be seen
_POSE = ("x_m", "y_m", "yaw_deg", "width_m", "floor_z_m")


class Crops(FrozenModel):
    """Crops of a frame that a data set holds.

    Attributes:
        kept: all candidates, labelled with the door that they hit or as no door; or the best candidate of each frame,
            labelled with the state of the frame whatever it shows, for one answer a frame.
        add_missed: add the visible doors that no candidate hits, with the finder's usual errors.
    """

    kept: Literal["all", "best"] = "all"
    add_missed: bool = False


def clean_and_find(cloud: Points, without_outliers: bool) -> tuple[Points, list[Doorway]]:
    """Return a level cloud without outliers, and its candidate doorways, best first."""
    if without_outliers:
        cloud = remove_outliers(cloud).points
    return cloud, find_doorways(cloud, find_floor_z_m(cloud))


def candidate_columns(row: Row, candidates: Sequence[Doorway], crops: Crops) -> list[tuple[Doorway, Columns]]:
    """Return the doorways to crop a simulated frame at, and the columns of their crops that differ from its line."""
    of_frame = flatten(row)
    if crops.kept == "best":
        main = next(iter(true_doors(row)), None)
        return [
            (doorway, _columns(of_frame, doorway, main, row.sample_id, "0")) for doorway in candidates[:1]
        ]
    chosen = [
        (doorway, _columns(of_frame, doorway, hit_door(row, doorway), f"{row.sample_id}-c{rank}", str(rank)))
        for rank, doorway in enumerate(candidates)
    ]
    if crops.add_missed:
        doorways = _missed(row, candidates)
        chosen += [
            (doorway, _columns(of_frame, doorway, door, f"{row.sample_id}-a{number}", ADDED))
            for number, (doorway, door) in enumerate(doorways)
        ]
    return chosen


def recorded_columns(row: Columns, doorway: Doorway) -> Columns:
    """Return the columns of the crop of a recorded cloud at its best candidate, which keeps the label of the cloud."""
    return _candidate_columns(row["sample_id"], doorway, "0")


def hit_door(row: Row, doorway: Doorway) -> TrueDoor | None:
    """Return the nearest door whose middle is within 0.35 m of a candidate's and whose wall within 20 degrees."""
    hits = [door for door in true_doors(row) if is_hit(door, doorway)]
    return min(hits, key=lambda door: gap(door, doorway)[0], default=None)


def frame_line(line: Columns) -> Columns:
    """Return the line of the frame that a crop was taken from; a line of a frame is returned as it is."""
    if not line.get("frame_id"):
        return line
    own = {name.removeprefix(_FRAME): text for name, text in line.items() if name.startswith(_FRAME)}
    return {**line, **own, "sample_id": line["frame_id"]}


def frame_row(line: Columns) -> Row:
    """Return the simulated row of the frame that a line shows, as a whole or a crop of it."""
    return unflatten(frame_line(line))


def doorway_of(line: Columns) -> Doorway:
    """Return the doorway at which the crop of a line was taken, in the sensor frame."""
    x_m, y_m, yaw_deg, width_m, floor_z_m = (float(line[f"doorway_{name}"]) for name in _POSE)
    return Doorway(x_m, y_m, yaw_deg, width_m, floor_z_m, score=float(line[FINDER_SCORE]))


def _missed(row: Row, candidates: Sequence[Doorway]) -> list[tuple[Doorway, TrueDoor]]:
    """Return the visible doors that no candidate hits, placed with errors."""
    least_px = _VISIBLE_SHARE * row.camera.width * row.camera.height
    rng = stage_rng(sample_seed(row.seed, row.sample_id), "missed doorways")
    missed = []
    for door in true_doors(row):
        along_m, across_m, turn_deg = (
            float(sigma * np.clip(rng.normal(), -_MOST_SIGMAS, _MOST_SIGMAS)) for sigma in _ADDED_ERRORS
        )
        if door.visible_px.total < least_px or any(is_hit(door, doorway) for doorway in candidates):
            continue
        yaw = math.radians(door.yaw_deg)
        doorway = Doorway(
            x_m=door.x_m + along_m * math.cos(yaw) - across_m * math.sin(yaw),
            y_m=door.y_m + along_m * math.sin(yaw) + across_m * math.cos(yaw),
            yaw_deg=door.yaw_deg + turn_deg,
            width_m=door.width_m,
            floor_z_m=candidates[0].floor_z_m if candidates else door.floor_z_m,
        )
        missed.append((doorway, door))
    return missed


def _columns(
    of_frame: Columns, doorway: Doorway, door: TrueDoor | None, sample_id: str, candidate: str
) -> Columns:
    """Return the columns of a crop that shows a door, or none, in place of those of its frame."""
    in_crop = {name: _text(value) for name, value in _door_columns(door, doorway).items()}
    return {
        "sample_id": sample_id,
        **in_crop,
        **_candidate_columns(of_frame["sample_id"], doorway, candidate),
        **{f"{_FRAME}{name}": of_frame[name] for name in in_crop},
    }


def _door_columns(door: TrueDoor | None, doorway: Doorway) -> dict[str, object]:
    """Return the columns of the door in a crop, in the frame of the doorway; empty ones without a door."""
    if door is None:
        return dict.fromkeys(DOOR_COLUMNS) | {"state": NO_DOOR, "ambiguous": False}
    x_m, y_m, z_m = doorway.to_doorway(np.array([door.x_m, door.y_m, door.floor_z_m])).tolist()
    pose = {
        "x_m": round(x_m, 5),
        "y_m": round(y_m, 5),
        "floor_z_m": round(z_m, 5),
        "yaw_deg": round(math.remainder(door.yaw_deg - doorway.yaw_deg, 360), 4),
    }
    return main_columns(door.model_copy(update=pose))


def _candidate_columns(frame_id: str, doorway: Doorway, candidate: str) -> dict[str, str]:
    pose = {f"doorway_{name}": _text(getattr(doorway, name)) for name in _POSE}
    return {"frame_id": frame_id, "candidate": candidate, **pose, FINDER_SCORE: _text(doorway.score)}


def _text(value: object) -> str:
    return "" if value is None else str(value)


def is_hit(door: TrueDoor, doorway: Doorway) -> bool:
    """Return True if a candidate's middle is within 0.35 m of a door's, and its wall within 20 degrees."""
    distance_m, turn_deg = gap(door, doorway)
    return distance_m <= HIT_M and turn_deg <= HIT_DEG
