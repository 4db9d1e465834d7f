# SPDX-License-Identifier: Apache-2.0
"""Cloud files and depth images of every supported format, read into the body frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from doorstate._input import read_input
from doorstate.errors import CloudReadError, DoorstateError, summarize_exception
from doorstate.io.arrays import parse_npy, parse_npz
from doorstate.io.body_frame import points_from_depth, points_in_body
from doorstate.io.formats import check_suffix, format_suffix, unpack_gzip
from doorstate.io.options import DEFAULT_OPTIONS, ReadOptions
from doorstate.io.pcd import parse_pcd
from doorstate.io.ply import parse_ply
from doorstate.io.png import parse_depth_png
from doorstate.io.sensor_pose import PosedCloud
from doorstate.io.size_limits import MAX_FILE_BYTES, check_byte_count, check_point_count
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

# A point in a file has at most this many values; an array with wider rows is a depth image.
_MAX_POINT_VALUES = 16


def read_cloud(path: str | Path, options: ReadOptions = DEFAULT_OPTIONS) -> Points:
    """Read one file as points in the body frame; its suffix selects the format.

    Args:
        path: a cloud (.pcd .ply .npy .npz .xyz .txt .csv) or a depth image (16-bit .png, 2-D .npy, .npz), also packed
            by gzip (.pcd.gz); a regular file of at most 256 MiB.
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
        suffix = format_suffix(path)
        if not path.is_dir():
            check_suffix(suffix)
        return parse_posed_cloud(read_input(path, MAX_FILE_BYTES), suffix, options)
    except DoorstateError as error:
        raise error.located(path) from error


def parse_cloud(data: bytes, suffix: str, options: ReadOptions = DEFAULT_OPTIONS) -> Points:
    """Read the content of a file as points in the body frame.

    Args:
        data: content of the file, also packed by gzip.
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
    check_byte_count(len(data))
    if not data:
        raise CloudReadError("is empty (0 bytes)")
    try:
        data = unpack_gzip(data)
        stored = _PARSERS[suffix](data)
        if suffix != ".png":
            stored = _without_single_axes(stored)
            if _holds_coordinates_as_rows(stored, options):
                stored = stored.T
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


def _without_single_axes(stored: NDArray[Any]) -> NDArray[Any]:
    """Return a depth image (1, H, W) or (H, W, 1), as networks for images store it, as (H, W)."""
    if stored.ndim == 3 and stored.shape[2] == 1:
        return stored[..., 0]
    is_wide = stored.ndim == 3 and stored.shape[2] > _MAX_POINT_VALUES
    return stored[0] if is_wide and stored.shape[0] == 1 else stored


def _holds_coordinates_as_rows(stored: NDArray[Any], options: ReadOptions) -> bool:
    """Return True for (3, N); with a camera given, other arrays with few rows are depth images.

    Raises:
        CloudReadError: an array with 4 to 16 rows can be either.
    """
    rows, width = stored.shape if stored.ndim == 2 else (0, 0)
    if not (3 <= rows <= _MAX_POINT_VALUES < width) or rows == getattr(options.intrinsics, "height", None):
        return False
    if rows > 3 and options.intrinsics is None:
        raise CloudReadError(
            f"holds shape {stored.shape}: coordinates as rows, or a depth image of {rows} rows",
            expected="a point in every row, (N, 3), or the camera of the depth image",
            suggestions={"intrinsics": None},
        )
    return bool(rows == 3)


def _rows(stored: NDArray[Any]) -> NDArray[Any]:
    if stored.ndim not in (2, 3) or not 3 <= stored.shape[-1] <= _MAX_POINT_VALUES:
        is_channels_first = stored.ndim == 3 and stored.shape[0] == 3
        raise CloudReadError(
            f"holds shape {stored.shape}",
            expected="(N, 3), (H, W, 3) or depth (H, W)",
            hint="store x, y and z as the last axis, not the first" if is_channels_first else None,
        )
    if stored.size == 0:  # shape (10**9, 0, 3) is valid, but nothing to compute with
        return np.empty((0, 3), np.float32)
    return stored[..., :3]
