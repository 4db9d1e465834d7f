# SPDX-License-Identifier: Apache-2.0
"""Any file a robot builder has, read into the one frame of the library: the door to the outside."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from doorstate.errors import CameraError, CloudReadError, ConfigError, DoorstateError, summarize_exception
from doorstate.io.arrays import parse_npy, parse_npz
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import check_roll, depth_to_points, points_from_optical, undo_roll
from doorstate.io.pcd import parse_pcd
from doorstate.io.ply import parse_ply
from doorstate.io.png import parse_depth_png
from doorstate.io.size_limits import check_point_count
from doorstate.io.text import parse_table
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

# A point of a file has at most this many values; an array of wider rows is a depth image.
_MAX_POINT_VALUES = 16
# The largest 16-bit value is how some recorders write "no return"; others write 0.
_NO_RETURN = 65535


@dataclass(frozen=True)
class ReadOptions:
    """What a file does not say about itself.

    Args:
        frame: frame of cloud files, `body` (x forward, y left, z up) or `optical` (x right, y down, z
            forward); depth images are always optical.
        roll_deg: how far the camera was turned clockwise, seen from behind: 0, 90, 180 or 270.
        intrinsics: camera of depth images; a `Pinhole` takes every image size.
        depth_scale_m: metres per stored unit of integer depth images.
        units_m: metres per unit of cloud files and of floating point depth images (metres by ROS REP 118).

    Raises:
        CameraError: one of them is impossible.
    """

    frame: Literal["body", "optical"] = "body"
    roll_deg: int = 0
    intrinsics: Intrinsics | Pinhole | None = None
    depth_scale_m: float = 0.001
    units_m: float = 1.0

    def __post_init__(self) -> None:
        if self.frame not in ("body", "optical"):
            raise CameraError(f"frame {self.frame!r} is neither 'body' nor 'optical'")
        for scale_m in (self.depth_scale_m, self.units_m):
            if not (math.isfinite(scale_m) and scale_m > 0):
                raise CameraError(f"a scale of {scale_m} metres per unit is impossible: it must be positive")
        check_roll(self.roll_deg)
        if isinstance(self.intrinsics, Pinhole):
            Intrinsics(1, 1, *self.intrinsics)  # whose numbers are checked
        elif not isinstance(self.intrinsics, Intrinsics | None):
            raise CameraError(f"intrinsics {self.intrinsics!r}: give Intrinsics or a Pinhole")


DEFAULT_OPTIONS = ReadOptions()
_BAGS = (".bag", ".db3", ".mcap")
_PREPARED = "dataset.json"  # of dataset.store
_ABOUT_CLOUDS = ("index.csv", "manifest.csv", "predictions.csv", "rejected.csv")
UNITS_M = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "km": 1000.0}


def options_from_flags(
    frame: str,
    roll: int,
    units: str,
    depth_scale: float,
    intrinsics: Intrinsics | None,
    flags: tuple[float | None, float | None, float | None, float | None],
) -> ReadOptions:
    """What a user says of files in the words of the command line.

    Args:
        frame, roll, depth_scale: as of `ReadOptions`.
        units: a name of `UNITS_M`.
        intrinsics: camera of depth images.
        flags: fx, fy, cx, cy in pixels: all or none.

    Raises:
        ConfigError: no such unit, some of the flags only, or flags beside intrinsics.
        CameraError: as of `ReadOptions`.
    """
    if units not in UNITS_M:
        raise ConfigError(f"--units {units}: choose one of {', '.join(UNITS_M)}")
    camera: Intrinsics | Pinhole | None = intrinsics
    if any(value is not None for value in flags):
        if camera is not None:
            raise ConfigError("--intrinsics and --fx --fy --cx --cy say the same: give one of them")
        fx, fy, cx, cy = flags
        if fx is None or fy is None or cx is None or cy is None:
            raise ConfigError("--fx, --fy, --cx and --cy belong together: give all four")
        camera = Pinhole(fx, fy, cx, cy)
    return ReadOptions(frame, roll, camera, depth_scale, UNITS_M[units])  # type: ignore[arg-type]


def read_cloud(path: str | Path, options: ReadOptions = DEFAULT_OPTIONS) -> Points:
    """Read one file, chosen by its suffix, as points in the body frame.

    Args:
        path: a cloud (.pcd .ply .npy .npz .xyz .txt .csv) or a depth image (16-bit .png, 2-D .npy, .npz).
        options: what the file does not say about itself.

    Returns:
        (N, 3), or (H, W, 3) of images and organized clouds, float32 metres, in file order, NaN kept.

    Raises:
        CloudReadError: when the file cannot be read as what its suffix says.
        CameraError: when a depth image lacks intrinsics or they are for another image size.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise CloudReadError("is a folder, not a file")
        check_suffix(path.suffix)
        return parse_cloud(_read_bytes(path), path.suffix, options)
    except DoorstateError as error:
        raise type(error)(f"{path.name}: {error}") from error


def parse_cloud(data: bytes, suffix: str, options: ReadOptions = DEFAULT_OPTIONS) -> Points:
    """Read the content of a file as `read_cloud` reads the file.

    Args:
        data: what the file holds.
        suffix: which reader to take, such as `.pcd`.
        options: what the file does not say about itself.

    Returns:
        As of `read_cloud`.

    Raises:
        CloudReadError: when the content cannot be read as what the suffix says.
        CameraError: when a depth image lacks intrinsics or they are for another image size.
    """
    suffix = suffix.lower()
    check_suffix(suffix)
    if not data:
        raise CloudReadError("is empty (0 bytes)")
    try:
        stored = _PARSERS[suffix](data)
        is_depth = suffix == ".png" or (stored.ndim == 2 and stored.shape[1] > _MAX_POINT_VALUES)
        check_point_count(math.prod(stored.shape if is_depth else stored.shape[:-1]))
        return points_from_depth(stored, options) if is_depth else _points_from_rows(stored, options)
    except DoorstateError:
        raise
    except Exception as error:
        # Foreign bytes make parsing libraries raise anything; to the user it is one thing.
        raise CloudReadError(f"damaged, or no {suffix} file ({summarize_exception(error)})") from error


def check_suffix(suffix: str) -> None:
    """Raise CloudReadError unless files that end so can be read."""
    if suffix.lower() not in _PARSERS:
        hint = "a recording: give it by --bag" if suffix.lower() in _BAGS else "unknown file type"
        raise CloudReadError(f"{hint}; clouds are {' '.join(CLOUD_SUFFIXES)}")


def find_clouds(paths: Sequence[Path]) -> list[Path]:
    """List the files to read: files as given, folders searched through.

    In folders, hidden files, colour images beside depth images (`*_rgb.png`) and tables about clouds (`index.csv`,
    `manifest.csv`, `predictions.csv`, `rejected.csv`) are passed over.

    Returns:
        Paths in the order given, those of one folder sorted as people count (2 before 10).

    Raises:
        CloudReadError: when a path does not exist, or a folder holds no cloud.
    """
    found: list[Path] = []
    for path in paths:
        if (path / _PREPARED).is_file():
            raise CloudReadError(
                f"{path}: a prepared data set: doorstate view shows it, train learns from it"
            )
        if path.is_dir():
            members = [member for member in path.rglob("*") if member.is_file()]
            clouds = [member for member in members if _is_cloud(member.relative_to(path))]
            if not clouds:
                hint = (
                    "a recording: give it by --bag"
                    if any(m.suffix in _BAGS for m in members)
                    else "no clouds in this folder"
                )
                raise CloudReadError(f"{path}: {hint}; clouds are {' '.join(CLOUD_SUFFIXES)}")
            found += sorted(clouds, key=_natural_order)
        elif path.exists():
            found.append(path)
        else:
            raise CloudReadError(f"{path}: no such file or folder")
    return found


def _is_cloud(path: Path) -> bool:
    hidden = any(part.startswith(".") for part in path.parts)
    about = path.name in _ABOUT_CLOUDS or path.name.lower().endswith("_rgb.png")
    return path.suffix.lower() in _PARSERS and not hidden and not about


def _natural_order(path: Path) -> tuple[list[str | int], str]:
    pieces = re.split(r"(\d+)", str(path).lower())
    return [int(piece) if place % 2 else piece for place, piece in enumerate(pieces)], str(path)


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise CloudReadError(f"cannot be read: {error.strerror or error}") from error


def points_from_depth(stored: NDArray[Any], options: ReadOptions) -> Points:
    """(H, W, 3) metres in the body frame of (H, W) stored depth.

    Raises:
        CameraError: intrinsics are missing, or are for another image size.
    """
    height, width = stored.shape
    intrinsics = options.intrinsics
    if intrinsics is None:
        raise CameraError(
            f"a depth image ({width} x {height} pixels) needs the camera's intrinsics: "
            "give --intrinsics FILE or --fx --fy --cx --cy"
        )
    if isinstance(intrinsics, Pinhole):
        intrinsics = _of_image(intrinsics, width, height)
    scale_m = _metres_per_unit(stored.dtype.kind == "f", options)
    with np.errstate(invalid="ignore"):  # a NaN that signals is a NaN
        depth_m = stored.astype(np.float64) * scale_m
    if stored.dtype.newbyteorder("=") == np.uint16:
        depth_m[stored == _NO_RETURN] = np.nan
    return depth_to_points(depth_m, intrinsics, options.roll_deg)


def _of_image(camera: Pinhole, width: int, height: int) -> Intrinsics:
    """A camera of whatever size as that of an image; its centre gives numbers of another resolution away."""
    if not (width / 4 <= camera.cx <= width * 3 / 4 and height / 4 <= camera.cy <= height * 3 / 4):
        raise CameraError(
            f"cx = {camera.cx:g}, cy = {camera.cy:g} are far from the middle of an image of {width} x {height} pixels: "
            "of another resolution? for a cut image say its size as well, in a file for --intrinsics"
        )
    return Intrinsics(width, height, *camera)


def _metres_per_unit(is_float: bool, options: ReadOptions) -> float:
    """The scale of the two that is for this kind of depth image; CameraError if only the other one was said."""
    if is_float:
        return options.units_m
    if options.units_m not in (1.0, options.depth_scale_m):
        raise CameraError(f"integer depth is not in --units: say --depth-scale {options.units_m:g}")
    return options.depth_scale_m


def _points_from_rows(stored: NDArray[Any], options: ReadOptions) -> Points:
    if stored.ndim not in (2, 3) or not 3 <= stored.shape[-1] <= _MAX_POINT_VALUES:
        raise CloudReadError(f"holds shape {stored.shape}: expected (N, 3), (H, W, 3) or depth (H, W)")
    if stored.size == 0:  # a side of a billion pixels beside one of none is no size to work with
        return np.empty((0, 3), np.float32)
    return points_in_body(stored[..., :3], options)


def points_in_body(stored: NDArray[Any], options: ReadOptions) -> Points:
    """Points (..., 3) in metres and in the body frame."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is as good as infinite: no return
        points = (stored.astype(np.float64) * options.units_m).astype(np.float32)
    if options.frame == "optical":
        points = points_from_optical(points)
    return undo_roll(points, options.roll_deg)
