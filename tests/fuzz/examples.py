# SPDX-License-Identifier: Apache-2.0
"""Small valid files of every format, to be damaged: clouds with points, and clouds in which nothing was measured."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image
from pypcd4.pypcd4 import Encoding, PointCloud

from doorstate.io.camera import Pinhole
from doorstate.types import Points
from tests.bag_writer import camera_info, cloud, compressed_image, image, text, write_bag

HEIGHT, WIDTH = 12, 16
CAMERA = Pinhole(14.0, 14.0, 7.5, 5.5)
SCENE: Points = np.random.default_rng(0).uniform(1, 3, (HEIGHT, WIDTH, 3)).astype(np.float32)
CLOUDS: tuple[Points, ...] = (
    SCENE,
    SCENE.reshape(-1, 3),
    np.full_like(SCENE, np.nan),
    np.full_like(SCENE, np.finfo(np.float32).max),
    np.zeros_like(SCENE),
    np.ones((200, 3), np.float32),
    SCENE.reshape(-1, 3)[:0],
)
CAMERA_SUFFIXES = (".json", ".yaml")
_COMPRESSIONS = {".bag": ("", "LZ4", "BZ2"), ".db3": ("", "MESSAGE"), ".mcap": ("", "STORAGE")}
_FOLDERS = (("db3", ""), ("db3", "MESSAGE"), ("db3", "FILE"), ("mcap", ""))


def saved(save: Callable[[io.BytesIO], Any]) -> bytes:
    """Return what a function writes to a file."""
    stream = io.BytesIO()
    save(stream)
    return stream.getvalue()


def depth_of(points: Points, dtype: str) -> NDArray[Any]:
    """Return a depth image (H, W) of a cloud: metres for floats, millimetres for integers."""
    rows = points if points.ndim == 3 else points.reshape(1, -1, 3)
    depth_m = rows[..., 0] if rows.size else np.zeros((1, 1), np.float32)
    with np.errstate(all="ignore"):
        return (
            depth_m.astype(dtype) if "f" in dtype else (np.nan_to_num(depth_m, posinf=0) * 1000).astype(dtype)
        )


def png_of(points: Points) -> bytes:
    return saved(lambda stream: Image.fromarray(depth_of(points, "<u2")).save(stream, "PNG"))


@cache
def files(suffix: str) -> tuple[bytes, ...]:
    """Return valid files of a cloud format."""
    match suffix:
        case ".pcd":
            return tuple(_pcd(points, kind) for points, kind in product(CLOUDS, Encoding))
        case ".ply":
            return tuple(_ply(points, kind) for points in CLOUDS for kind in ("ascii", "little", "big"))
        case ".png":
            return tuple(png_of(points) for points in CLOUDS)
        case ".npy" | ".npz":
            arrays = [*CLOUDS, *(depth_of(SCENE, dtype) for dtype in ("<f4", ">u2", "<i8"))]
            save = np.save if suffix == ".npy" else np.savez_compressed
            return tuple(saved(lambda stream, array=array: save(stream, array)) for array in arrays)
    return tuple(
        _text(points, mark, header)
        for points in CLOUDS[1:]
        for mark, header in product(" ,;", ("", "x y z\n", "# z y x\n"))
    )


def _pcd(points: Points, encoding: Encoding) -> bytes:
    pcd = PointCloud.from_xyz_points(points.reshape(-1, 3))
    if points.ndim == 3:
        pcd.metadata.height, pcd.metadata.width = points.shape[:2]
    return saved(lambda stream: pcd.save(stream, encoding=encoding))


def _ply(points: Points, kind: str) -> bytes:
    flat = points.reshape(-1, 3)
    encoding = kind if kind == "ascii" else f"binary_{kind}_endian"
    body = (
        _text(flat, " ", "")
        if kind == "ascii"
        else flat.astype("<f4" if kind == "little" else ">f4").tobytes()
    )
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    return f"ply\nformat {encoding} 1.0\nelement vertex {len(flat)}\n{properties}end_header\n".encode() + body


def _text(points: Points, separator: str, header: str) -> bytes:
    rows = "\n".join(separator.join(map(str, row)) for row in points.reshape(-1, 3)[:150].tolist())
    return (header.replace(" ", separator) + rows).encode()


@cache
def camera_files(suffix: str) -> tuple[bytes, ...]:
    """Return valid camera files, in JSON or YAML."""
    fx, fy, cx, cy = CAMERA
    size = {"width": WIDTH, "height": HEIGHT}
    matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    cameras: list[dict[str, Any]] = [
        size | {"fx": fx, "fy": fy, "ppx": cx, "ppy": cy, "coeffs": [0, 0, 0, 0, 0]},
        size | {"distortion_model": "plumb_bob", "K": matrix},
        {
            "image_width": WIDTH,
            "image_height": HEIGHT,
            "camera_matrix": {"rows": 3, "cols": 3, "data": matrix},
        },
    ]
    dump = json.dumps if suffix == ".json" else yaml.safe_dump
    return tuple(dump(camera).encode() for camera in cameras)


def _messages(points: Points) -> list[Any]:
    numbers = (CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1)
    return [
        text("/chatter"),
        camera_info("/depth/camera_info", WIDTH, HEIGHT, numbers, [0] * 12),
        cloud("/points", points),
        image("/depth/raw", depth_of(SCENE, "<u2"), "16UC1"),
        image("/depth/metres", depth_of(SCENE, "<f4"), "32FC1"),
        compressed_image(
            "/depth/raw/compressedDepth", bytes(12) + png_of(SCENE), "16UC1; compressedDepth png"
        ),
    ]


@cache
def bags(suffix: str) -> tuple[bytes, ...]:
    """Return valid bags of one file each."""
    contents = []
    for points, compression in product((SCENE, CLOUDS[2]), _COMPRESSIONS[suffix]):
        with TemporaryDirectory() as folder:
            path = write_bag(Path(folder), suffix[1:], _messages(points), compression)
            file = path if path.is_file() else path / f"{path.name}{suffix}"
            contents.append(file.read_bytes())
    return tuple(contents)


def write_bag_folder(folder: Path) -> tuple[bytes, ...]:
    """Write the files of several ROS 2 bags into one folder, and return the metadata.yaml of each."""
    metadata = []
    for kind, compression in _FOLDERS:
        with TemporaryDirectory() as scratch:
            bag = write_bag(Path(scratch), kind, _messages(SCENE), compression)
            (store,) = bag.glob(f"{bag.name}.*")
            name = f"{compression}{store.name}"
            (folder / name).write_bytes(store.read_bytes())
            metadata.append((bag / "metadata.yaml").read_bytes().replace(store.name.encode(), name.encode()))
    return tuple(metadata)
