# SPDX-License-Identifier: Apache-2.0
"""Clouds of an exact size from raw clouds and simulated frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import CloudSpec, PreparedCloud, prepare_cloud
from doorstate.clouds.samplers import choose_sampler
from doorstate.errors import CloudContentError
from doorstate.simulation.frames import Frame
from doorstate.types import Points


def sample_cloud(points: Points, spec: CloudSpec) -> PreparedCloud:
    """Prepare a cloud of exactly `spec.num_points` points.

    Raises:
        CloudContentError: there are fewer distinct points.
    """
    prepared = prepare_cloud(points, spec, choose_sampler(import_torch=True))
    count = len(prepared.points)
    if count < spec.num_points:
        raise CloudContentError(
            f"too few points: {count} distinct, {spec.num_points} needed", suggestions={"num_points": count}
        )
    return prepared


def sample_frame(frame: Frame, spec: CloudSpec) -> tuple[Points, NDArray[np.uint8]]:
    """Return points (n, 3) in metres in farthest-point order, and the part of each (doorstate.types.Part).

    Raises:
        CloudContentError: the frame has fewer distinct points.
    """
    cloud, indices = sample_cloud(frame.points, spec)
    return cloud, frame.cut.part.reshape(-1)[indices]
