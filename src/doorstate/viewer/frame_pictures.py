# SPDX-License-Identifier: Apache-2.0
"""Pictures of a labelled frame: its colour image and its depth."""

from __future__ import annotations

from contextlib import suppress

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from doorstate._input import open_input
from doorstate._paths import resolve_inside
from doorstate.dataset.labelled import LabelledFrame
from doorstate.io.size_limits import MAX_FILE_BYTES, check_point_count
from doorstate.pages.encoding import picture_uri
from doorstate.types import Points

_DEPTH_QUANTILES = (0.02, 0.98)  # ends of the colour scale, so that outliers do not take all colours
_UNMEASURED_RGB = (70, 70, 70)


def frame_pictures(frame: LabelledFrame, cloud: Points) -> dict[str, str]:
    """Return data URIs by name: `colour` if the index names an image, `depth` of an organized cloud."""
    pictures = {}
    colour = frame.columns.get("rgb", "")
    if colour:
        # The page does not depend on the picture, which may be damaged; Pillow raises exceptions of any type.
        path = resolve_inside(frame.folder, colour)
        with suppress(Exception), open_input(path, MAX_FILE_BYTES) as stream, Image.open(stream) as image:
            check_point_count(image.width * image.height)
            pictures["colour"] = picture_uri(np.asarray(image.convert("RGB")))
    if cloud.ndim == 3:
        pictures["depth"] = picture_uri(_depth_picture(cloud))
    return pictures


def _depth_picture(cloud: Points) -> NDArray[np.uint8]:
    """Return (H, W, 3) colours of an organized cloud: near is bright, unmeasured is grey."""
    depth_m = cloud[..., 0].astype(np.float64)
    measured = np.isfinite(depth_m) & (depth_m != 0)
    picture = np.full((*depth_m.shape, 3), _UNMEASURED_RGB, dtype=np.uint8)
    if measured.any():
        near_m, far_m = np.quantile(depth_m[measured], _DEPTH_QUANTILES)
        share = np.clip((depth_m[measured] - near_m) / max(1e-6, far_m - near_m), 0, 1)
        picture[measured] = (mpl.colormaps["viridis_r"](share)[:, :3] * 255).astype(np.uint8)
    return picture
