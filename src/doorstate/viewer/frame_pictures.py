# SPDX-License-Identifier: Apache-2.0
"""Pictures of a labelled frame: its colour image and its depth."""

from __future__ import annotations

from doorstate._paths import resolve_inside
from doorstate.dataset.labelled import LabelledFrame
from doorstate.pages.encoding import picture_uri
from doorstate.types import Points
from doorstate.viewer.depth_picture import colour_picture, depth_picture


def frame_pictures(frame: LabelledFrame, cloud: Points) -> dict[str, str]:
    """Return data URIs by name: `colour` if the index names an image, `depth` of an organized cloud."""
    pictures = {}
    name = frame.columns.get("rgb", "")
    if name and (colour := colour_picture(resolve_inside(frame.folder, name))) is not None:
        pictures["colour"] = picture_uri(colour)
    if cloud.ndim == 3:
        pictures["depth"] = picture_uri(depth_picture(cloud))
    return pictures
