# SPDX-License-Identifier: Apache-2.0
"""Clouds of labelled frames as a predictor gives them to its network, in a prepared data set.

For weights of doorways, the label of a frame belongs to the candidate at the place of the door, where the index tells
it; else to the one that the predictor takes for the main door, and without any to the finder's best. All crops of a
frame without a door show none. Other candidates have no label and are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from doorstate import __version__
from doorstate._files import write_csv
from doorstate._jobs import Progress, WorkersOrEngine, no_progress, piece_paths, run_pieces
from doorstate._paths import csv_name
from doorstate.clouds.preparation import PreparedCloud
from doorstate.dataset.crops import Columns, Crops, recorded_columns
from doorstate.dataset.description import DESCRIPTION_FILE, DatasetDescription
from doorstate.dataset.labelled import LabelledFrame
from doorstate.dataset.pieces import PieceClouds, Sample, SavedPieces
from doorstate.dataset.sampling import rejected_sample
from doorstate.dataset.store import CLOUDS_FILE, PARTS_FILE, PreparedDataset, open_dataset
from doorstate.errors import DatasetError, DoorstateError
from doorstate.inference.doorway_predictor import DoorwayPredictor
from doorstate.inference.known import DoorHint
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.posed import predict_posed
from doorstate.simulation.manifest import MANIFEST_FILE
from doorstate.types import NO_DOOR, Part

_FRAMES_PER_PIECE = 4
_NO_DOORWAY = "no doorway was found"
FRAME_COLUMN = "frame_name"  # of the frame that a sample was made from


class SiteFrames(NamedTuple):
    """Clouds of labelled frames, and the frames without any by name, with the reason."""

    dataset: PreparedDataset
    left_out: dict[str, str]


class _Piece(NamedTuple):
    weights: str
    frames: Sequence[LabelledFrame]
    names: Sequence[str]


def frame_names(frames: Sequence[LabelledFrame]) -> list[str]:
    """Return a name for each frame: its file below its folder; with the number of the folder if there are several."""
    folders = list(dict.fromkeys(frame.folder for frame in frames))
    prefixes = {folder: f"{number}/" if len(folders) > 1 else "" for number, folder in enumerate(folders)}
    return [f"{prefixes[frame.folder]}{csv_name(frame.name)}" for frame in frames]


def prepare_frames(
    frames: Sequence[LabelledFrame],
    weights: Path,
    folder: Path,
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
) -> SiteFrames:
    """Prepare the clouds of frames into a folder, continuing where a killed preparation stopped.

    Args:
        frames: frames with a state or without a door.
        weights: weights file whose predictor prepares them.
        folder: output folder.
        workers: processes, None is one per processor; or an engine.
        progress: called with pieces done and pieces in all.

    Raises:
        DatasetError: no cloud could be prepared.
    """
    names = frame_names(frames)
    rows = [
        {**frame.columns, "sample_id": name, "file": frame.file, "state": frame.label, FRAME_COLUMN: name}
        for frame, name in zip(frames, names, strict=True)
    ]
    starts = range(0, len(frames), _FRAMES_PER_PIECE)
    pieces = [
        _Piece(
            str(weights), frames[start : start + _FRAMES_PER_PIECE], names[start : start + _FRAMES_PER_PIECE]
        )
        for start in starts
    ]
    paths = piece_paths(folder / "pieces", len(pieces), ".npz")
    run_pieces(_prepare_piece, pieces, paths, workers, progress)
    saved = SavedPieces.read(paths)
    kept, rejected = saved.lines(rows)
    left_out = {row["sample_id"]: row["reason"] for row in rejected}
    if not kept:
        raise DatasetError(f"none of {len(rows)} frames can be used; the first: {rejected[0]['reason']}")
    if not (folder / DESCRIPTION_FILE).is_file():
        card = load_predictor(str(weights)).card
        saved.join_clouds(folder / CLOUDS_FILE, card.points_in_use)
        saved.join_parts(folder / PARTS_FILE, card.points_in_use)
        write_csv(folder / MANIFEST_FILE, kept)
        DatasetDescription(
            kind="imported",
            source="site",
            num_points=card.points_in_use,
            samples=len(kept),
            max_depth_m=card.max_depth_m,
            remove_outliers=card.remove_outliers,
            crops=Crops(kept="best") if card.input == "doorway" else None,
            doorstate_version=__version__,
        ).save(folder)
    return SiteFrames(open_dataset(folder), left_out)


@lru_cache(maxsize=1)
def load_predictor(weights: str) -> NetworkPredictor:
    """Load the predictor of a weights file."""
    return NetworkPredictor.from_weights(weights)


def _prepare_piece(piece: _Piece, path: Path) -> None:
    predictor = load_predictor(piece.weights)
    clouds = PieceClouds(predictor.num_points)
    for frame, name in zip(piece.frames, piece.names, strict=True):
        try:
            clouds.add(_samples(predictor, frame, name))
        except DoorstateError as error:
            clouds.add([rejected_sample(error)])
    clouds.save(path)


def _samples(predictor: NetworkPredictor, frame: LabelledFrame, name: str) -> list[Sample]:
    cloud, pose = frame.read()
    if not isinstance(predictor, DoorwayPredictor):
        return [_sample(predictor.prepare(cloud), predictor.num_points)]
    at = None if frame.label == NO_DOOR else frame.doorway
    place = None if at is None else DoorHint(at.x_m, at.y_m, at.yaw_deg, at.width_m)
    candidates = predictor.candidates(
        cloud,
        door_known=False if place is None else place,
        is_level=pose.is_tilt_known,
        camera_height_m=pose.camera_height_m,
    )
    if not candidates:
        return [Sample(None, reason=_NO_DOORWAY)]
    if frame.label == NO_DOOR:
        chosen = {f"{name}-c{rank}": pair for rank, pair in enumerate(candidates)}
    elif place is not None:
        chosen = {name: candidates[0]}
    else:
        doors = predict_posed(predictor, cloud, pose).doors
        score = doors[0].score if doors else None
        chosen = {name: next((pair for pair in candidates if pair[0].score == score), candidates[0])}
    return [
        _sample(
            crop,
            predictor.num_points,
            {**recorded_columns({"sample_id": name}, doorway), "sample_id": sample},
        )
        for sample, (doorway, crop) in chosen.items()
    ]


def _sample(prepared: PreparedCloud, num_points: int, columns: Columns = MappingProxyType({})) -> Sample:
    """Return a sample of exactly this size: after all distinct points, farthest-point order may repeat any of them."""
    points = prepared.points[np.arange(num_points) % len(prepared.points)]
    return Sample(points, np.full(num_points, Part.NONE, np.uint8), columns)
