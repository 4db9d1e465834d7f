# SPDX-License-Identifier: Apache-2.0
"""Clouds, detections and pictures as text in a page; `clouds.js` decodes them."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from doorstate.rules.base import Detection
from doorstate.types import Points

_PICTURE_PX = (400, 300)


def encode_cloud(points: Points, parts: NDArray[np.uint8] | None = None) -> dict[str, str | None]:
    """Return a cloud as `clouds.js` decodes it.

    Args:
        points: (N, 3) metres; rounded to millimetres and limited to 32 m.
        parts: (N,) values of `Part`, or None.
    """
    limit = np.iinfo(np.int16)
    millimetres = np.clip(np.rint(points * 1000.0), limit.min, limit.max).astype("<i2")
    return {
        "points": encode_bytes(millimetres.tobytes()),
        "parts": None if parts is None else encode_bytes(parts.tobytes()),
    }


def encode_detections(detections: Iterable[Detection]) -> list[dict[str, Any]]:
    """Encode detections for the page: name and points in metres, outlines closed."""
    return [
        {"name": detection.name, "points": np.round(closed(detection), 3).tolist()}
        for detection in detections
    ]


def closed(detection: Detection) -> NDArray[np.float64]:
    """Return the (K, 3) points of a detection; an outline ends where it starts."""
    points = detection.points_m
    return np.concatenate([points, points[:1]]) if len(points) > 2 else points


def picture_uri(picture: NDArray[np.uint8], size_px: tuple[int, int] = _PICTURE_PX) -> str:
    """Return (H, W, 3) pixels as a JPEG of at most a size (width, height) in a data URI."""
    image = Image.fromarray(picture)
    image.thumbnail(size_px)
    encoded = io.BytesIO()
    image.save(encoded, format="JPEG", quality=85)
    return data_uri(encoded.getvalue(), "image/jpeg")


def data_uri(content: bytes, media_type: str) -> str:
    """Return the content of a file as a data URI."""
    return f"data:{media_type};base64,{encode_bytes(content)}"


def encode_bytes(content: bytes) -> str:
    """Return bytes in base 64."""
    return base64.b64encode(content).decode("ascii")
