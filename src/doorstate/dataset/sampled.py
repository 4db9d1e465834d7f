# SPDX-License-Identifier: Apache-2.0
"""A simulated cloud from its frame: sampled, with the part of every point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.preparation import prepare_cloud
from doorstate.errors import CloudContentError
from doorstate.simulation.frames import Frame
from doorstate.types import Points


def exactly(
    points: Points, num_points: int, max_depth_m: float | None = None, thin: bool = False
) -> tuple[Points, NDArray[np.int64]]:
    """`num_points` distinct points in farthest-point order, none deeper than that, and their rows.

    Depth and thinning are those of `clouds.preparation.prepare_cloud`.

    Raises:
        CloudContentError: there are fewer.
    """
    prepared = prepare_cloud(points, num_points, thin=thin, max_depth_m=max_depth_m)
    if len(prepared.points) < num_points:
        raise CloudContentError(
            f"too few points: {len(prepared.points)} distinct, {num_points} asked for (--points)"
        )
    return prepared


def sample_frame(
    frame: Frame, num_points: int, max_depth_m: float | None = None, thin: bool = False
) -> tuple[Points, NDArray[np.uint8]]:
    """(n, 3) metres in farthest-point order, and the part of each (doorstate.types.Part).

    Raises:
        CloudContentError: the frame shows fewer distinct points.
    """
    cloud, indices = exactly(frame.points, num_points, max_depth_m, thin)
    return cloud, frame.cut.part.reshape(-1)[indices]
