# SPDX-License-Identifier: Apache-2.0
"""Cloud files and depth images of every supported format, read into the body frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CloudReadError, DoorstateError, summarize_exception
from doorstate.io.arrays import parse_npy, parse_npz
from doorstate.io.body_frame import points_from_depth, points_in_body
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.io.pcd import parse_pcd
from doorstate.io.ply import parse_ply
from doorstate.io.png import parse_depth_png
from doorstate.io.sensor_pose import PosedCloud
from doorstate.io.size_limits import check_point_count
from doorstate.io.text import parse_table
from doorstate.io.viewpoint import read_viewpoint
from doorstate.types import Points

_PARSERS: dict[str, Callable[[bytes], NDArray[Any]]] = {
    ".pcd": parse_pcd,
    ".ply": parse_ply,
    ".npy": parse_npy,
    ".npz": parse_npz,
    ".xyz": parse_table,
    ".txt": parse_table,
    ".csv": parse_table,
    ".png": parse_depth_png,
}
CLOUD_SUFFIXES: tuple[str, ...] = tuple(_PARSERS)
BAG_SUFFIXES = (".bag", ".db3", ".mcap")
OPEN_BAG_HINT = "open recordings as ROS bags"

# A point in a file has at most this many values; an array with wider rows is a depth image.
_MAX_POINT_VALUES = 16


def read_cloud(path: str | Path, options: ReadOptions = DEFAULT_OPTIONS) -> Points:
    """Read one file as points in the body frame; its suffix selects the format.

    Args:
        path: a cloud (.pcd .ply .npy .npz .xyz .txt .csv) or a depth image (16-bit .png, 2-D .npy, .npz).
        options: axes, tilt, units and camera.

    Returns:
        (N, 3), or (H, W, 3) for images and organized clouds, float32 metres, in file order, NaN kept.

    Raises:
        CloudReadError: the file does not have the format of its suffix.
        CameraError: a depth image without intrinsics, or with those of another image size.
    """
    return read_posed_cloud(path, options).points


def read_posed_cloud(path: str | Path, options: ReadOptions = DEFAULT_OPTIONS) -> PosedCloud:
    """Read one file as `read_cloud` does, with the pose of its camera."""
    path = Path(path)
    try:
        if path.is_dir():
            raise CloudReadError("is a folder, not a file")
        check_suffix(path.suffix)
        return parse_posed_cloud(_read_bytes(path), path.suffix, options)
    except DoorstateError as error:
        raise error.located(path) from error


def parse_cloud(data: bytes, suffix: str, options: ReadOptions = DEFAULT_OPTIONS) -> Points:
    """Read the content of a file as points in the body frame.

    Args:
        data: content of the file.
        suffix: format, such as `.pcd`.
        options: axes, tilt, units and camera.

    Returns:
        The points that `read_cloud` returns.

    Raises:
        CloudReadError: the content does not have this format.
        CameraError: a depth image without intrinsics, or with those of another image size.
    """
    return parse_posed_cloud(data, suffix, options).points


def parse_posed_cloud(data: bytes, suffix: str, options: ReadOptions = DEFAULT_OPTIONS) -> PosedCloud:
    """Read the content of a file as `parse_cloud` does, with the pose of its camera."""
    suffix = suffix.lower()
    check_suffix(suffix)
    if not data:
        raise CloudReadError("is empty (0 bytes)")
    try:
        stored = _PARSERS[suffix](data)
        is_depth = suffix == ".png" or (stored.ndim == 2 and stored.shape[1] > _MAX_POINT_VALUES)
        check_point_count(math.prod(stored.shape if is_depth else stored.shape[:-1]))
        if is_depth:
            return points_from_depth(stored, options)
        viewpoint = read_viewpoint(data) if suffix == ".pcd" and not options.ignore_viewpoint else None
        return points_in_body(_rows(stored), options, viewpoint=viewpoint)
    except DoorstateError:
        raise
    except Exception as error:
        # On damaged bytes parsing libraries raise exceptions of any type.
        raise CloudReadError(f"damaged, or no {suffix} file ({summarize_exception(error)})") from error


def check_suffix(suffix: str) -> None:
    """Check that files with this suffix can be read.

    Raises:
        CloudReadError: they cannot.
    """
    if suffix.lower() not in _PARSERS:
        raise CloudReadError(
            f"unknown file type {suffix!r}",
            expected=" ".join(CLOUD_SUFFIXES),
            hint=OPEN_BAG_HINT if suffix.lower() in BAG_SUFFIXES else None,
        )


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise CloudReadError(f"cannot be read: {error.strerror or error}") from error


def _rows(stored: NDArray[Any]) -> NDArray[Any]:
    if stored.ndim not in (2, 3) or not 3 <= stored.shape[-1] <= _MAX_POINT_VALUES:
        raise CloudReadError(f"holds shape {stored.shape}", expected="(N, 3), (H, W, 3) or depth (H, W)")
    if stored.size == 0:  # shape (10**9, 0, 3) is valid, but nothing to compute with
        return np.empty((0, 3), np.float32)
    return stored[..., :3]
