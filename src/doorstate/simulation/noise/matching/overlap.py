# SPDX-License-Identifier: Apache-2.0
"""Pixels without a partner in the second view: behind an edge, or outside of it.

With the second view at a baseline b to the right, a pixel at column u and depth z lies at column u - f b / z there. A
matcher takes pixels of a row to keep their order, so a pixel is hidden if one to its right lies to its left there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doorstate.simulation.noise.windows import Image

_TOLERANCE_PX = 0.5  # assumed: smaller overlaps are one surface


def lacks_overlap(disparity_px: Image, has_band: bool) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that the second view does not see.

    Args:
        disparity_px: (H, W), 0 where there is none.
        has_band: the second view's image ends as the first one does, so a band at the left is outside of it.
    """
    column = np.arange(disparity_px.shape[1], dtype=np.float32) - disparity_px
    leftmost = np.minimum.accumulate(column[:, ::-1], axis=1)[:, ::-1]
    leftmost += np.float32(_TOLERANCE_PX)
    hidden: NDArray[np.bool_] = leftmost < column
    if has_band:
        outside = column < np.float32(-0.5)
        hidden |= outside & (disparity_px > 0)
    return hidden
