# SPDX-License-Identifier: Apache-2.0
"""Clouds of an exact size from raw clouds and simulated frames, whole or cropped to doorways."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.outliers import remove_outliers
from doorstate.clouds.preparation import CloudSpec, PreparedCloud, prepare_cloud
from doorstate.clouds.samplers import choose_sampler
from doorstate.dataset.crops import (
    Columns,
    Crops,
    candidate_columns,
    clean_and_find,
    doorway_of,
    recorded_columns,
)
from doorstate.dataset.pieces import Sample
from doorstate.doorways.crop import CropSpec, crop_cloud
from doorstate.doorways.doorway import Doorway
from doorstate.errors import CloudContentError, CloudError, DoorstateError
from doorstate.simulation.frames import Frame
from doorstate.simulation.row import Row
from doorstate.types import NO_DOOR, Points

_NO_DOORWAY: Final = "no doorway was found"


def sample_cloud(points: Points, spec: CloudSpec) -> PreparedCloud:
    """Prepare a cloud of exactly `spec.num_points` points.

    Raises:
        CloudContentError: there are fewer distinct points.
    """
    return _exactly(spec.num_points, prepare_cloud(points, spec, choose_sampler(import_torch=True)))


def sample_frame(frame: Frame, spec: CloudSpec) -> tuple[Points, NDArray[np.uint8]]:
    """Return points (n, 3) in metres in farthest-point order, and the part of each (doorstate.types.Part).

    Raises:
        CloudContentError: the frame has fewer distinct points.
    """
    return _with_parts(frame, sample_cloud(frame.points, spec))


def sample_crop(frame: Frame, line: Columns, spec: CloudSpec) -> tuple[Points, NDArray[np.uint8]]:
    """Return the same of a crop by its line of a manifest, in the frame of its doorway.

    Raises:
        CloudContentError: there are fewer distinct points around the doorway.
    """
    cloud = remove_outliers(frame.points).points if spec.remove_outliers else frame.points
    return _with_parts(frame, _crop(cloud, doorway_of(line), spec))


def samples_of_frame(row: Row, frame: Frame, spec: CloudSpec, crops: Crops | None) -> list[Sample]:
    """Return the samples of a simulated frame: its whole cloud, or crops of it.

    Args:
        row: row of the frame.
        frame: rendered frame.
        spec: number of points, and preparation.
        crops: which crops; None for the whole cloud.
    """
    if crops is None:
        try:
            return [Sample(*sample_frame(frame, spec))]
        except CloudError as error:
            return [rejected_sample(error)]
    cloud, candidates = clean_and_find(frame.points, spec.remove_outliers)
    chosen = candidate_columns(row, candidates, crops)
    if not chosen:
        return [Sample(None, reason=_NO_DOORWAY)]
    samples = []
    for doorway, columns in chosen:
        try:
            samples.append(Sample(*_with_parts(frame, _crop(cloud, doorway, spec)), columns))
        except CloudError as error:
            samples.append(rejected_sample(error, columns))
    # Too few points around a place without a door are no loss.
    useful = [sample for sample in samples if not sample.reason or sample.columns["state"] != NO_DOOR]
    return useful or samples[:1]


def samples_of_recording(row: Columns, points: Points, spec: CloudSpec, crops: Crops | None) -> list[Sample]:
    """Return the sample of a recorded, level cloud: whole, or the crop at its best candidate.

    Args:
        row: line of the cloud.
        points: (N, 3) or organized (H, W, 3) metres.
        spec: number of points, and preparation.
        crops: which crops; None for the whole cloud.
    """
    if crops is None:
        return [Sample(sample_cloud(points, spec).points)]
    cloud, candidates = clean_and_find(points, spec.remove_outliers)
    if not candidates:
        return [Sample(None, reason=_NO_DOORWAY)]
    columns = recorded_columns(row, candidates[0])
    return [Sample(_crop(cloud, candidates[0], spec).points, columns=columns)]


def rejected_sample(error: DoorstateError, columns: Columns = MappingProxyType({})) -> Sample:
    """Return the sample of a cloud that cannot be used."""
    return Sample(None, columns=columns, reason=error.describe(with_path=False))


def _crop(cloud: Points, doorway: Doorway, spec: CloudSpec) -> PreparedCloud:
    sampler = choose_sampler(import_torch=True)
    return _exactly(
        spec.num_points, crop_cloud(cloud, doorway, CropSpec(num_points=spec.num_points), sampler)
    )


def _exactly(num_points: int, prepared: PreparedCloud) -> PreparedCloud:
    count = len(prepared.points)
    if count < num_points:
        raise CloudContentError(
            f"too few points: {count} distinct, {num_points} needed", suggestions={"num_points": count}
        )
    return prepared


def _with_parts(frame: Frame, prepared: PreparedCloud) -> tuple[Points, NDArray[np.uint8]]:
    return prepared.points, frame.cut.part.reshape(-1)[prepared.indices]
