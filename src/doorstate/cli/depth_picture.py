# SPDX-License-Identifier: Apache-2.0
"""Depth image in a terminal: two pixels a character, near is bright, frames of doors in the colours of their states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rich.color import Color
from rich.style import Style
from rich.text import Text

from doorstate.cameras.device import DepthFrame
from doorstate.inference.door_lines import DOOR_FRAME, Line
from doorstate.inference.door_report import DoorReport
from doorstate.io.camera import Intrinsics

_NEAR_M, _FAR_M = 0.8, 8.0
_NEAR_RGB, _FAR_RGB = np.array([235, 238, 245]), np.array([38, 44, 60])
_NOTHING_RGB = np.array([0, 0, 0])
_STATE_RGB = {"closed": (255, 85, 85), "semi_open": (255, 215, 60), "open": (60, 225, 110)}
_NO_STATE_RGB = (255, 255, 255)
_LEAST_DEPTH_M = 0.1  # of a point of a line that can be seen
_PARTS = 200  # of a piece of a line; more than there are pixels

RGB = NDArray[np.uint8]


def depth_picture(frame: DepthFrame, report: DoorReport, columns: int, rows: int) -> Text:
    """Return a picture of at most this size, in the proportions of the image.

    Args:
        frame: depth image.
        report: doors in it, in the optical frame of the image.
        columns, rows: characters; a character is twice as high as wide.
    """
    height, width = frame.depth.shape
    columns = max(2, min(columns, width, round(2 * rows * width / height)))
    rows = max(1, round(columns * height / width / 2))
    pixels = depth_pixels(frame, columns, 2 * rows)
    frames = [line for line in report.lines if line.name == DOOR_FRAME]
    for door, line in reversed([*zip(report.prediction.doors, frames, strict=False)]):
        draw_line(pixels, line, frame.intrinsics, _STATE_RGB.get(str(door.state), _NO_STATE_RGB))
    picture = Text(no_wrap=True)
    for upper, lower in zip(pixels[::2], pixels[1::2], strict=True):
        for top, bottom in zip(upper.tolist(), lower.tolist(), strict=True):
            picture.append("▀", Style(color=Color.from_rgb(*top), bgcolor=Color.from_rgb(*bottom)))
        picture.append("\n")
    return picture


def depth_pixels(frame: DepthFrame, width: int, height: int) -> RGB:
    """Return the colours (height, width, 3) of pixels spread evenly over an image."""
    full_height, full_width = frame.depth.shape
    v = (np.arange(height) + 0.5) * full_height / height
    u = (np.arange(width) + 0.5) * full_width / width
    depth_m = frame.depth[np.ix_(v.astype(int), u.astype(int))].astype(np.float32) * frame.depth_scale_m
    is_measured = np.isfinite(depth_m) & (depth_m > 0)
    nearness = 1 / np.clip(np.where(is_measured, depth_m, _FAR_M), _NEAR_M, _FAR_M)
    share = ((nearness - 1 / _FAR_M) / (1 / _NEAR_M - 1 / _FAR_M))[..., None]
    colors = share * _NEAR_RGB + (1 - share) * _FAR_RGB
    return np.where(is_measured[..., None], colors, _NOTHING_RGB).astype(np.uint8)


def draw_line(pixels: RGB, line: Line, camera: Intrinsics, rgb: tuple[int, int, int]) -> None:
    """Draw a line of the optical frame over the colours of an image; what is behind the camera is left out."""
    height, width, _ = pixels.shape
    shares = np.linspace(0, 1, _PARTS)[:, None]
    for start, end in zip(line.points_m[:-1], line.points_m[1:], strict=True):
        points = start + shares * (end - start)
        x, y, z = points[points[:, 2] > _LEAST_DEPTH_M].T
        u = (camera.fx * x / z + camera.cx + 0.5) * width / camera.width
        v = (camera.fy * y / z + camera.cy + 0.5) * height / camera.height
        is_inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        pixels[v[is_inside].astype(int), u[is_inside].astype(int)] = rgb
