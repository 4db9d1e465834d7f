# SPDX-License-Identifier: Apache-2.0
"""Files written by other libraries, or by hand and read by them: the readers give the same points."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray
from PIL import Image
from pypcd4.pypcd4 import Encoding, PointCloud

from doorstate.io.arrays import parse_npy
from doorstate.io.pcd import parse_pcd
from doorstate.io.ply import parse_ply
from doorstate.io.png import parse_depth_png
from doorstate.io.text import parse_table
from tests.fuzz.examples import saved

_SETTINGS = settings(max_examples=60, suppress_health_check=list(HealthCheck))
_NUMBERS = (np.float32, np.float64, np.int16, np.uint8, np.uint32)
_points = npst.arrays(np.float32, st.tuples(st.integers(1, 9), st.just(3)), elements=st.floats(width=32))


@given(
    _points,
    st.permutations(["x", "y", "z", "rgb", "normal", "_"]),
    st.lists(st.sampled_from(_NUMBERS), min_size=3, max_size=3),
    st.sampled_from([Encoding.ASCII, Encoding.BINARY, Encoding.BINARY_COMPRESSED]),
)
@_SETTINGS
def test_pcd_as_pypcd4(
    points: NDArray[np.float32], names: list[str], kinds: list[type], encoding: Encoding
) -> None:
    others = dict(zip(("rgb", "normal", "_"), kinds, strict=True))
    columns = [
        points[:, "xyz".index(name)] if name in "xyz" else np.ones(len(points), others[name])
        for name in names
    ]
    types = [others.get(name, np.float32) for name in names]
    cloud = PointCloud.from_points(columns, names, types)
    data = saved(lambda stream: cloud.save(stream, encoding=encoding))
    read = PointCloud.from_fileobj(io.BufferedReader(io.BytesIO(data)))  # type: ignore[arg-type]
    np.testing.assert_array_equal(parse_pcd(data).astype(np.float32), read.numpy(("x", "y", "z")))


@given(_points, st.sampled_from(["ascii", "binary_little_endian"]), st.booleans())
@_SETTINGS
def test_ply_as_trimesh(points: NDArray[np.float32], encoding: str, has_faces: bool) -> None:
    faces = [[0, len(points) - 1, 0]] if has_faces else []
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat {encoding} 1.0\nelement vertex {len(points)}\n{properties}"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\n" if faces else ""
    if encoding == "ascii":
        body = "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in points.tolist())
        body += "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)
        data = f"{header}end_header\n{body}".encode()
    else:
        body_bytes = points.astype("<f4").tobytes()
        body_bytes += b"".join(b"\3" + np.array(face, "<i4").tobytes() for face in faces)
        data = f"{header}end_header\n".encode() + body_bytes
    read = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    np.testing.assert_array_equal(parse_ply(data).astype(np.float32), np.asarray(read.vertices, np.float32))


@given(_points, st.sampled_from([None, ",", ";"]), st.sampled_from(["%.9g", "%.9e", "%+.9g"]))
@_SETTINGS
def test_text_as_numpy(points: NDArray[np.float32], delimiter: str | None, number: str) -> None:
    data = saved(lambda stream: np.savetxt(stream, points, number, delimiter or " "))
    read = np.loadtxt(io.BytesIO(data), delimiter=delimiter, ndmin=2)
    np.testing.assert_array_equal(parse_table(data), read)


@given(npst.arrays(st.sampled_from(["<f2", "<f4", ">f8", "<i4", ">u2"]), npst.array_shapes(max_dims=3)))
@_SETTINGS
def test_npy_as_numpy(array: NDArray[np.generic]) -> None:
    data = saved(lambda stream: np.save(stream, array))
    np.testing.assert_array_equal(parse_npy(data), np.load(io.BytesIO(data)))


@given(npst.arrays(np.uint16, npst.array_shapes(min_dims=2, max_dims=2)), st.integers(0, 9))
@_SETTINGS
def test_png_as_pillow(pixels: NDArray[np.uint16], level: int) -> None:
    data = saved(lambda stream: Image.fromarray(pixels).save(stream, "PNG", compress_level=level))
    with Image.open(io.BytesIO(data)) as image:
        np.testing.assert_array_equal(parse_depth_png(data), np.asarray(image))
    np.testing.assert_array_equal(parse_depth_png(data), pixels)


@given(points=_points, kind=st.sampled_from(["bag", "db3", "mcap"]))
@settings(_SETTINGS, max_examples=10)
def test_bags_as_rosbags(
    points: NDArray[np.float32], kind: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    from doorstate.io.bags import open_bag
    from tests.bag_writer import cloud, write_bag

    path = write_bag(tmp_path_factory.mktemp("bag"), kind, [cloud("/points", points)])
    with open_bag(path) as bag:
        (stamped,) = bag.clouds(bag.choose())
    # Other users of rosbags in the process get definitions as before.
    with AnyReader([Path(path)]) as reader:
        connection, _, raw = next(reader.messages())
        message = reader.deserialize(raw, connection.msgtype)
    stored = np.frombuffer(message.data, "<f4").reshape(message.width, -1)[:, :3]
    np.testing.assert_array_equal(stamped.cloud, stored)
