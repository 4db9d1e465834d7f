# SPDX-License-Identifier: Apache-2.0
"""Files and messages that no camera wrote: valid ones of every type, hollow clouds in them, and ways to break them.

Everything is drawn from the generator that is handed over, so a seed is enough to have an input again.
"""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.lib import format as npy_format
from numpy.typing import NDArray
from PIL import Image

from doorstate.io.readers import CLOUD_SUFFIXES
from doorstate.types import Points

Edit = tuple[str, int, bytes]  # replace, insert, delete or cut; where; with what
EDITS = ("replace", "insert", "delete", "cut")
MESSAGES = ("PointCloud2", "Image", "CompressedImage")
CAMERA_SUFFIXES = (".json", ".yaml")
TOKENS = (b"0", b"9", b"-1", b"99999999999", b"nan", b"\n", b" ", b",", b"x", b"#", b"\xff" * 4, b"\0" * 4)
YAML_TOKENS = (
    *TOKENS,
    b"&a ",
    b"*a",
    b"<<: ",
    b"!!python/name:os.system ",
    b"!!binary ",
    b": ",
    b"- ",
    b"[",
    b"{",
    b"'",
)
_NUMBERS = (
    b"-1",
    b"0",
    b"1",
    b"3",
    b"2147483648",
    b"9223372036854775808",
    b"1" + b"0" * 30,
    b"nan",
    b"1e9",
    b"",
)
_HEADER_BYTES = (
    300  # of every type, in which most sizes and types are said; of archives and bags the last ones
)
_TEXT_ROWS = 400
_TYPES = (*["<f4"] * 9, "<f8", ">f4", "<f2", "<i2", "<u2", "<i8", "<c8", "|u1", "|b1", "<U3", "|O")


def mutate(data: bytes, edits: Sequence[Edit]) -> bytes:
    """Bytes after edits; places wrap around."""
    mutated = bytearray(data)
    for kind, place, content in edits:
        start = place % (len(mutated) + 1)
        match kind:
            case "replace":
                mutated[start : start + len(content)] = content
            case "insert":
                mutated[start:start] = content
            case "delete":
                del mutated[start : start + len(content)]
            case "cut":
                del mutated[start:]
    return bytes(mutated)


def saved(save: Callable[[io.BytesIO], Any]) -> bytes:
    """What is written to a file."""
    stream = io.BytesIO()
    save(stream)
    return stream.getvalue()


_HOLLOW: dict[str, Callable[[Points], Points]] = {
    "NaN": lambda points: np.full_like(points, np.nan),
    "infinite": lambda points: np.full_like(points, np.inf),
    "at the origin": np.zeros_like,
    "beyond all measure": lambda points: np.full_like(points, np.finfo(np.float32).max),
    "one point": lambda points: np.zeros_like(points) + np.array([2, 0.1, 0.2], np.float32),
    "tiny": lambda points: points * np.float32(1e-38),
    "few": lambda points: points.reshape(-1, 3)[:20],
    "none": lambda points: points.reshape(-1, 3)[:0],
    "one measured": lambda points: np.where(np.arange(points.size).reshape(points.shape) < 3, points, np.nan),
}


def draw_points(rng: np.random.Generator, scene: Points) -> Points:
    """The scene, as an image or flat, or a cloud of its shape that holds nothing: one of three."""
    points = scene if rng.random() < 0.5 else scene.reshape(-1, 3)
    if rng.random() < 2 / 3:
        return points
    hollow: Points = _HOLLOW[str(rng.choice(list(_HOLLOW)))](points).astype(np.float32)
    return hollow


def draw_file(rng: np.random.Generator, suffix: str, scene: Points) -> bytes:
    """A file of this type, broken in four cases of five.

    Args:
        rng: decides everything.
        suffix: one of `CLOUD_SUFFIXES`.
        scene: (H, W, 3) organized cloud that a state can be told from.
    """
    data = draw_broken(rng, lambda: _WRITERS[suffix](rng, draw_points(rng, scene)))
    return sealed(data) if suffix == ".png" and rng.random() < 0.5 else data


def draw_camera_file(rng: np.random.Generator, suffix: str, scene: Points) -> bytes:
    """A file with the camera of a scene as one of `CAMERA_SUFFIXES`, broken as `draw_file` breaks."""
    return draw_broken(rng, lambda: _camera(rng, suffix, scene), YAML_TOKENS)


def draw_broken(
    rng: np.random.Generator, write: Callable[[], bytes], tokens: Sequence[bytes] = TOKENS
) -> bytes:
    """What is written, in one case of five as it is; otherwise with other bytes, or noise in its place."""
    chance = rng.random()
    if chance < 0.05:
        return rng.bytes(int(rng.integers(0, 400)))
    data = write()
    if chance < 0.25:
        return data
    if chance < 0.5:
        data = _other_number(rng, data)
    return mutate(data, draw_edits(rng, len(data), tokens))


def draw_edits(rng: np.random.Generator, size: int, tokens: Sequence[bytes] = TOKENS) -> list[Edit]:
    """One to four edits, most of them in what is the header or the index of most files."""
    return [
        (
            str(rng.choice(EDITS, p=(0.4, 0.25, 0.25, 0.1))),
            int(
                rng.choice(
                    [rng.integers(_HEADER_BYTES), -rng.integers(1, _HEADER_BYTES), rng.integers(size + 1)]
                )
            ),
            tokens[int(rng.integers(len(tokens)))]
            if rng.random() < 0.7
            else rng.bytes(int(rng.integers(1, 5))),
        )
        for _ in range(rng.integers(1, 5))
    ]


def _other_number(rng: np.random.Generator, data: bytes) -> bytes:
    """One number of the header says something else."""
    found = list(re.finditer(rb"\d+", data[:_HEADER_BYTES]))
    if not found:
        return data
    chosen = found[rng.integers(len(found))]
    return data[: chosen.start()] + _NUMBERS[rng.integers(len(_NUMBERS))] + data[chosen.end() :]


def _rows(points: Points, separator: str = " ") -> str:
    return "\n".join(separator.join(map(str, row)) for row in points.reshape(-1, 3)[:_TEXT_ROWS].tolist())


def _pcd(rng: np.random.Generator, points: Points) -> bytes:
    from pypcd4.pypcd4 import Encoding, PointCloud

    flat = points.reshape(-1, 3)
    cloud = PointCloud.from_xyz_points(flat)
    kind = list(Encoding)[rng.integers(3)]
    if kind is Encoding.ASCII:
        cloud = PointCloud.from_xyz_points(flat[:_TEXT_ROWS])
    elif points.ndim == 3:
        cloud.metadata.height, cloud.metadata.width = points.shape[:2]
    return saved(lambda stream: cloud.save(stream, encoding=kind))


def _ply(rng: np.random.Generator, points: Points) -> bytes:
    flat = points.reshape(-1, 3)
    kind = str(rng.choice(["ascii", "binary_little_endian", "binary_big_endian"]))
    if kind == "ascii":
        flat = flat[:_TEXT_ROWS]
    body = (
        _rows(flat).encode()
        if kind == "ascii"
        else flat.astype("<f4" if "little" in kind else ">f4").tobytes()
    )
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    return f"ply\nformat {kind} 1.0\nelement vertex {len(flat)}\n{properties}end_header\n".encode() + body


def _array(rng: np.random.Generator, points: Points) -> NDArray[Any]:
    """Points or depth, as any type of numbers or none."""
    stored = points[..., 0] if points.ndim == 3 and rng.random() < 0.5 else points
    with np.errstate(all="ignore"):
        return stored.astype(_TYPES[rng.integers(len(_TYPES))])


def _npy(rng: np.random.Generator, points: Points) -> bytes:
    if rng.random() < 0.1:
        kind, shape = _TYPES[rng.integers(len(_TYPES))], [draw_number(rng) for _ in range(rng.integers(4))]
        header = {"descr": kind, "fortran_order": False, "shape": tuple(shape)}
        return saved(lambda stream: npy_format.write_array_header_1_0(stream, header)) + rng.bytes(100)
    return saved(lambda stream: np.save(stream, _array(rng, points), allow_pickle=True))


def _npz(rng: np.random.Generator, points: Points) -> bytes:
    save = np.savez_compressed if rng.random() < 0.5 else np.savez
    name = str(rng.choice(["points", "depth", "arr_0", "\udcff/..", "é" * 300]))
    if name.isprintable():
        arrays: dict[str, Any] = {name: _array(rng, points), "other": np.zeros(3)}
        return saved(lambda stream: save(stream, **arrays))
    return saved(lambda stream: save(stream, points=np.array([print], dtype=object), allow_pickle=True))


def _text(rng: np.random.Generator, points: Points) -> bytes:
    separator = str(rng.choice([" ", ",", ";", "\t"]))
    header = str(rng.choice(["", "x y z\n", "# z y x\n", "//X Y Z\n", "\ufeffid x y z\n"])).replace(
        " ", separator
    )
    return (header + _rows(points, separator)).encode(
        str(rng.choice(["utf-8", "utf-16", "latin-1"])), "replace"
    )


def _png(rng: np.random.Generator, points: Points) -> bytes:
    depth = _depth(points, "<u2")
    if rng.random() < 0.1:
        depth = depth.astype(np.uint8)
    return saved(lambda stream: Image.fromarray(depth).save(stream, "PNG"))


def draw_depth(rng: np.random.Generator, scene: Points, stored: str) -> NDArray[Any]:
    """(H, W) depth of points as `draw_points` gives them: metres as floats, or millimetres."""
    return _depth(draw_points(rng, scene), stored)


def _depth(points: Points, stored: str) -> NDArray[Any]:
    image = points if points.ndim == 3 else points.reshape(1, -1, 3)
    depth_m = image[..., 0] if image.size else np.zeros((1, 1), np.float32)
    with np.errstate(all="ignore"):
        return (
            depth_m.astype(stored)
            if "f" in stored
            else (np.nan_to_num(depth_m, posinf=0) * 1000).astype(stored)
        )


def _camera(rng: np.random.Generator, suffix: str, scene: Points) -> bytes:
    height, width = scene.shape[:2]
    fx, fy, cx, cy = (
        float(rng.choice([width, width / 2, 0.0, 1e-300, 1e300, -1.0, np.nan]))
        if rng.random() < 0.1
        else width / 2
        for _ in range(4)
    )
    size = {"width": width, "height": height}
    matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    forms: list[dict[str, Any]] = [
        size | {"fx": fx, "fy": fy, "cx": cx, "cy": cy},
        size | {"fx": fx, "fy": fy, "ppx": cx, "ppy": cy, "coeffs": [0, 0, 0, 0, 0]},
        size | {"distortion_model": "plumb_bob", "K": matrix},
        size | {"k": [matrix[:3], matrix[3:6], matrix[6:]]},
        {
            "image_width": width,
            "image_height": height,
            "camera_matrix": {"rows": 3, "cols": 3, "data": matrix},
        },
    ]
    form = forms[rng.integers(len(forms))]
    text = json.dumps(form) if suffix == ".json" else yaml.safe_dump(form) + str(rng.choice(["", "---\n"]))
    return text.encode()


_WRITERS: dict[str, Callable[[np.random.Generator, Points], bytes]] = {
    ".pcd": _pcd, ".ply": _ply, ".npy": _npy, ".npz": _npz, ".xyz": _text, ".txt": _text, ".csv": _text, ".png": _png,
}  # fmt: skip
assert set(_WRITERS) == set(CLOUD_SUFFIXES)


class Field(NamedTuple):
    """As sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int
    count: int  # type: ignore[assignment] # tuples have a method of that name


def draw_cloud_message(rng: np.random.Generator, scene: Points) -> SimpleNamespace:
    """As sensor_msgs/PointCloud2."""
    points = draw_points(rng, scene)
    height, width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    message: dict[str, Any] = {
        "height": height,
        "width": width,
        "fields": [Field(axis, 4 * place, 7, 1) for place, axis in enumerate("xyz")],
        "is_bigendian": False,
        "point_step": 12,
        "row_step": 12 * width,
        "data": points.astype("<f4").tobytes(),
    }
    if rng.random() < 0.3:
        axis = int(rng.integers(3))
        name = str(rng.choice(["x", "y", "intensity", "\udcff", ""]))
        odd = Field(name, draw_number(rng), int(rng.choice([7, 8, 2, 0, 255])), int(rng.choice([1, 0, 3])))
        message["fields"][axis] = odd
    return _broken_message(rng, message)


def draw_image_message(rng: np.random.Generator, scene: Points) -> SimpleNamespace:
    """As sensor_msgs/Image."""
    encoding = str(rng.choice(["16UC1", "mono16", "32FC1", "rgb8", "", "\udcff"]))
    pixels = draw_depth(rng, scene, "<f4" if encoding == "32FC1" else "<u2")
    message = {
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": encoding,
        "is_bigendian": bool(rng.random() < 0.2),
        "step": pixels.shape[1] * pixels.itemsize,
        "data": pixels.tobytes(),
    }
    return _broken_message(rng, message)


def draw_compressed_message(rng: np.random.Generator, scene: Points) -> SimpleNamespace:
    """As sensor_msgs/CompressedImage."""
    parameters = rng.bytes(12) if rng.random() < 0.5 else np.array([0, 100, 1], "<f4").tobytes()
    encodings = [
        "16UC1; compressedDepth png",
        "32FC1; compressedDepth",
        "16UC1; compressedDepth rvl",
        "jpeg",
        "",
    ]
    return SimpleNamespace(
        format=str(rng.choice(encodings, p=(0.5, 0.3, 0.1, 0.05, 0.05))),
        data=(parameters + draw_file(rng, ".png", scene))[int(rng.choice([0, 0, 0, 5])) :],
    )


def _broken_message(rng: np.random.Generator, message: dict[str, Any]) -> SimpleNamespace:
    """A message with up to two numbers exchanged, and its data broken in one case of three."""
    sizes = [name for name, value in message.items() if type(value) is int]
    for name in rng.choice(sizes, int(rng.integers(0, 3)), replace=False):
        message[str(name)] = draw_number(rng)
    if rng.random() < 1 / 3:
        message["data"] = mutate(message["data"], draw_edits(rng, len(message["data"])))
    return SimpleNamespace(**message)


def draw_number(rng: np.random.Generator) -> int:
    """A size or offset as broken drivers and attackers send them."""
    return int(rng.choice([-1, 0, 1, 2, 3, 11, 12, 16, 80, 960, 65535, 2**31 - 1, 2**31, 2**32 - 1]))


def bomb(suffix: str, count: int) -> bytes:
    """A small file that unpacks to so many points or pixels, all zero; of types that pack nothing, one long row."""
    if suffix == ".npz":
        return saved(lambda stream: _write_npz_bomb(stream, count))
    if suffix == ".png":
        pack = zlib.compressobj()
        rows = b"".join(pack.compress(bytes(1 + 2 * 4096)) for _ in range(count // 4096)) + pack.flush()
        header = struct.pack(">IIBBBBB", 4096, count // 4096, 16, 0, 0, 0, 0)
        return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", rows) + _chunk(b"IEND", b"")
    if suffix == ".pcd":
        fields = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        packed = bytes(count * 12 // 80)
        sizes = struct.pack("<II", len(packed), count * 12)
        return f"VERSION 0.7\n{fields}POINTS {count}\nDATA binary_compressed\n".encode() + sizes + packed
    return b"[" * 100_000 if suffix == ".npy" else b"1 " * 100_000


def _write_npz_bomb(stream: io.BytesIO, count: int) -> None:
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("points.npy", "w", force_zip64=True) as member,
    ):
        shape = {"descr": "<f4", "fortran_order": False, "shape": (count, 3)}
        npy_format.write_array_header_1_0(member, shape)
        for start in range(0, count, 4096):
            member.write(bytes(12 * min(4096, count - start)))


def sealed(png: bytes) -> bytes:
    """A PNG whose checksums are right, as far as it is one."""
    kept, place = png[:8], 8
    while place + 12 <= len(png):
        size = int.from_bytes(png[place : place + 4], "big")
        content = png[place + 8 : place + 8 + size]
        kept += png[place : place + 4] + _chunk(png[place + 4 : place + 8], content)[4:]
        place += 12 + size
    return kept + png[place:]


def _chunk(kind: bytes, content: bytes) -> bytes:
    """Of a PNG."""
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
