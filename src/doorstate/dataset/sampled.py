# SPDX-License-Identifier: Apache-2.0
"""A simulated cloud from its frame: sampled, with the part of every point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import CloudSpec, PreparedCloud, prepare_cloud
from doorstate.errors import CloudContentError
from doorstate.simulation.frames import Frame
from doorstate.types import Points


def exactly(points: Points, spec: CloudSpec) -> PreparedCloud:
    """Prepare a cloud that must give all `spec.num_points` points.

    Raises:
        CloudContentError: there are fewer distinct points.
    """
    prepared = prepare_cloud(points, spec)
    if len(prepared.points) < spec.num_points:
        found = len(prepared.points)
        raise CloudContentError(
            f"too few points: {found} distinct, {spec.num_points} needed", suggestions={"points": found}
        )
    return prepared


def sample_frame(frame: Frame, spec: CloudSpec) -> tuple[Points, NDArray[np.uint8]]:
    """Return points (n, 3) in metres in farthest-point order, and the part of each (doorstate.types.Part).

    Raises:
        CloudContentError: the frame shows fewer distinct points.
    """
    cloud, indices = exactly(frame.points, spec)
    return cloud, frame.cut.part.reshape(-1)[indices]
