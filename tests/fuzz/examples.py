# SPDX-License-Identifier: Apache-2.0
"""Small valid files of every format, to be damaged: clouds with points, and clouds in which nothing was measured."""

from __future__ import annotations

import gzip
import io
import json
import re
import struct
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
from tests.bag_writer import camera_info, cloud, compressed_image, image, text, write_bag, write_mcap
from tests.rvl import encode

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


def rvl_of(points: Points) -> bytes:
    return encode(depth_of(points, "<u2"))


@cache
def files(suffix: str) -> tuple[bytes, ...]:
    """Return valid files of a cloud format."""
    match suffix:
        case ".pcd":
            return (*(_pcd(points, kind) for points, kind in product(CLOUDS, Encoding)), *_odd_pcd())
        case ".ply":
            kinds = ("ascii", "little", "big")
            return (*(_ply(points, kind) for points in CLOUDS for kind in kinds), *map(_ply_of_lists, kinds))
        case ".png":
            return tuple(png_of(points) for points in CLOUDS)
        case ".npy" | ".npz":
            arrays = [*CLOUDS, *(depth_of(SCENE, dtype) for dtype in ("<f4", ">u2", "<i8"))]
            arrays += [CLOUDS[1].T, _structured(SCENE), depth_of(SCENE, "<f4")[None]]
            save = np.save if suffix == ".npy" else np.savez_compressed
            return tuple(saved(lambda stream, array=array: save(stream, array)) for array in arrays)
    plain = [
        _text(points, mark, header)
        for points in CLOUDS[1:]
        for mark, header in product(" ,;", ("", "x y z\n", "# z y x\n"))
    ]
    rows = plain[0]
    count = b"%d\n" % (rows.count(b"\n") + 1)
    named = b"Time (s),X [m],Y [m],Z [m]\n" + b"".join(b"0.1,%s\n" % row for row in plain[1].split(b"\n"))
    decimal = _text(SCENE, ";", "").replace(b".", b",")
    spelled = rows + b"\n-nan(ind) 1.#QNAN nan(0x7fc00000)\n1.#INF NA null"
    quoted = b'"x","y","z"\n' + b"\n".join(
        b'"%s"' % row.replace(b",", b'","') for row in plain[1].split(b"\n")
    )
    odd = [count + rows, named, decimal, decimal.replace(b";", b" "), spelled, quoted]
    return tuple(
        plain
        + odd
        + [rows.replace(b"\n", b"\r"), rows.decode().encode("utf-16"), gzip.compress(rows, mtime=0)]
    )


def _odd_pcd() -> list[bytes]:
    """Return files that PCL reads: COLUMNS, COUNT 0, no sizes, CR line ends."""
    text, binary = _pcd(CLOUDS[1], Encoding.ASCII), _pcd(SCENE, Encoding.BINARY)
    columns = text.replace(b"FIELDS", b"COLUMNS")
    sizes = re.sub(rb"(SIZE|TYPE|COUNT) .*\n", b"", text)
    empty = binary.replace(b"x y z", b"_ x y z").replace(b"SIZE 4", b"SIZE 1 4")
    empty = empty.replace(b"TYPE F", b"TYPE U F").replace(b"COUNT 1", b"COUNT 0 1")
    return [columns, sizes, empty, text.replace(b"\n", b"\r"), gzip.compress(binary, mtime=0)]


def _ply_of_lists(kind: str) -> bytes:
    """Return vertices with lists of other lengths before and after their coordinates."""
    encoding = kind if kind == "ascii" else f"binary_{kind}_endian"
    mark = ">" if kind == "big" else "<"
    rows = []
    for place, point in enumerate(CLOUDS[1].tolist()):
        before, after = [7] * (place % 3), [8] * (place % 2)
        cells = [len(before), *before, *point, len(after), *after]
        form = f"{mark}B{len(before)}h3fi{len(after)}B"
        rows.append(
            " ".join(map(str, cells)).encode() + b"\n" if kind == "ascii" else struct.pack(form, *cells)
        )
    properties = "property list uchar short k\nproperty float x\nproperty float y\nproperty float z\n"
    properties += "property list int uchar l\n"
    header = f"ply\nformat {encoding} 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    return header.encode() + b"".join(rows)


def _structured(points: Points) -> NDArray[Any]:
    stored = np.zeros(points.shape[:-1], [("z", "<f4"), ("x", "<f8"), ("y", ">f4"), ("label", "u1")])
    for axis, name in enumerate("xyz"):
        stored[name] = points[..., axis]
    return stored


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


def bodies() -> tuple[bytes, ...]:
    """Return bodies of requests: a file, a form, and both packed."""
    name = 'Content-Disposition: form-data; name="file"; filename="cloud.npy"'
    file = saved(lambda stream: np.save(stream, SCENE))
    form = f"--edge\r\n{name}\r\n\r\n".encode() + file + b"\r\n--edge--\r\n"
    return (
        file,
        form,
        gzip.compress(file, mtime=0),
        gzip.compress(form, mtime=0),
        form.replace(file, gzip.compress(file, mtime=0)),
    )


BODY_HEADERS: tuple[dict[str, str], ...] = (
    {},
    {"content-encoding": "gzip"},
    {"content-type": "multipart/form-data; boundary=edge"},
    {"content-type": "multipart/form-data; boundary=edge", "content-encoding": "gzip"},
)


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
        compressed_image(
            "/depth/rvl/compressedDepth", bytes(12) + rvl_of(SCENE), "16UC1; compressedDepth rvl"
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
    if suffix == ".mcap":
        with TemporaryDirectory() as folder:
            for profile, encoding in product(("ros1", ""), ("ros1", "cdr", "json")):
                path = write_mcap(Path(folder) / "a.mcap", _messages(SCENE), profile, encoding)
                contents.append(path.read_bytes())
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
