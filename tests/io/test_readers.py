# SPDX-License-Identifier: Apache-2.0
"""Files of every format, read into the body frame; damaged files are errors in one line."""

from __future__ import annotations

import gzip
import os
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from doorstate.errors import MAX_MESSAGE_LENGTH, CameraError, CloudReadError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.formats import CLOUD_SUFFIXES, suffix_of_content, unpack_at_most, unpack_gzip
from doorstate.io.options import ReadOptions
from doorstate.io.pcd import write_pcd
from doorstate.io.readers import parse_cloud, read_cloud
from doorstate.io.size_limits import MAX_FILE_BYTES, MAX_POINTS
from tests.fuzz.examples import saved
from tests.io.bombs import bomb

NAN = np.nan
POINTS = np.array([[1.5, -2.25, 3.125], [NAN, NAN, NAN], [0.5, 0.25, -8.0], [4.0, 1.0, 0.5]], np.float32)
CAMERA = Intrinsics(20, 4, fx=16.0, fy=16.0, cx=9.5, cy=1.5)
DEPTH_MM = np.arange(500, 580, dtype=np.uint16).reshape(4, 20)
DEPTH_MM[1, 2:4] = 0, 65535

PLY_HEADER = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\n" + b"".join(
    b"property float %s\n" % axis for axis in (b"x", b"y", b"z")
)


def _write(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def _pcd_bytes(folder: Path) -> bytes:
    write_pcd(folder / "valid.pcd", POINTS)
    return (folder / "valid.pcd").read_bytes()


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """One small file of each suffix that holds POINTS, and a depth image as PNG."""
    rows = "\n".join(" ".join(map(str, row)) for row in POINTS.tolist())
    return {
        ".pcd": _pcd_bytes(tmp_path_factory.mktemp("valid")),
        ".ply": PLY_HEADER + b"end_header\n" + POINTS.tobytes(),
        ".npy": saved(lambda stream: np.save(stream, POINTS)),
        ".npz": saved(lambda stream: np.savez_compressed(stream, cloud=POINTS)),
        ".xyz": rows.encode(),
        ".txt": rows.replace(" ", ";").encode(),
        ".csv": b"x,y,z\n" + rows.replace(" ", ",").encode(),
        ".png": saved(lambda stream: Image.fromarray(DEPTH_MM).save(stream, "PNG")),
    }


def read_error(path: Path) -> CloudReadError:
    """Return the error of a file, after checking that it is one line."""
    with pytest.raises(CloudReadError) as caught:
        read_cloud(path)
    assert caught.value.path == path
    assert str(caught.value).isprintable()
    return caught.value


@pytest.mark.parametrize("suffix", sorted(set(CLOUD_SUFFIXES) - {".png"}))
@pytest.mark.parametrize("upper", [False, True])
def test_every_suffix_gives_the_same_points(
    tmp_path: Path, valid: dict[str, bytes], suffix: str, upper: bool
) -> None:
    points = read_cloud(_write(tmp_path, "a" + (suffix.upper() if upper else suffix), valid[suffix]))
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, POINTS)


def test_frame_units_and_roll_of_a_cloud(tmp_path: Path) -> None:
    # Optical millimetres: 2 m ahead, 1 m to the left, 0.5 m above the axis.
    path = _write(tmp_path, "a.xyz", "-1000 -500 2000\n")
    options = ReadOptions(axes="optical", units_m=0.001)
    assert read_cloud(path, options).tolist() == [[2.0, 1.0, 0.5]]
    # The camera was turned clockwise by 90 degrees: its left is up, its up is right.
    turned = ReadOptions(axes="optical", units_m=0.001, roll_deg=90)
    assert read_cloud(path, turned).tolist() == [[2.0, -0.5, 1.0]]
    assert read_cloud(_write(tmp_path, "b.xyz", "2 1 0.5"), ReadOptions(roll_deg=180)).tolist() == [
        [2.0, -1.0, -0.5]
    ]


@pytest.mark.parametrize("dtype", ["<f2", ">f4", "<f8", "<i2", ">i4", "<u2"])
def test_point_arrays_of_any_number_type(tmp_path: Path, dtype: str) -> None:
    array = np.arange(12).reshape(4, 3).astype(dtype)
    for stored in (array, np.hstack([array, array]), array.reshape(2, 2, 3), np.asfortranarray(array)):
        np.save(tmp_path / "a.npy", stored)
        points = read_cloud(tmp_path / "a.npy").reshape(-1, 3)
        np.testing.assert_array_equal(points, np.arange(12).reshape(4, 3))


def test_an_organized_cloud_stays_an_image(tmp_path: Path) -> None:
    grid = np.random.default_rng(0).normal(size=(3, 5, 3)).astype(np.float32)
    grid[1, 2] = NAN
    path = tmp_path / "grid.npy"
    np.save(path, grid)
    np.testing.assert_array_equal(read_cloud(path), grid)
    write_pcd(tmp_path / "grid.pcd", grid)
    np.testing.assert_array_equal(read_cloud(tmp_path / "grid.pcd"), grid)


@pytest.mark.parametrize("roll_deg", [0, 90, 180, 270])
@pytest.mark.parametrize("name", ["d.png", "d.npy", "big_endian.npy", "d.npz"])
def test_depth_images_are_read_from_every_format(tmp_path: Path, name: str, roll_deg: int) -> None:
    path = tmp_path / name
    match path.suffix:
        case ".png":
            Image.fromarray(DEPTH_MM).save(path)
        case ".npy":
            np.save(path, DEPTH_MM.astype(">u2") if "big" in name else DEPTH_MM)
        case ".npz":
            np.savez(path, depth=DEPTH_MM, other=np.zeros(3))
    depth_m = DEPTH_MM / 1000
    depth_m[1, 2:4] = NAN  # both mean "not measured"
    points = read_cloud(path, ReadOptions(intrinsics=CAMERA, roll_deg=roll_deg, axes="optical"))
    np.testing.assert_array_equal(points, depth_to_points(depth_m, CAMERA, roll_deg))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(points[..., 0])), [22, 23])


def test_scales_of_stored_depth(tmp_path: Path) -> None:
    np.save(tmp_path / "integer.npy", np.full((4, 20), 5000, np.uint16))
    np.save(tmp_path / "metres.npy", np.full((4, 20), 1.25, np.float32))
    np.save(tmp_path / "signed.npy", np.full((4, 20), -1, np.int32))
    tum = ReadOptions(intrinsics=CAMERA, depth_scale_m=1 / 5000)
    assert set(read_cloud(tmp_path / "integer.npy", tum)[..., 0].ravel()) == {1.0}
    assert set(read_cloud(tmp_path / "metres.npy", tum)[..., 0].ravel()) == {1.25}
    assert np.isnan(read_cloud(tmp_path / "signed.npy", tum)).all()


def test_a_narrow_png_is_still_a_depth_image(tmp_path: Path) -> None:
    Image.fromarray(np.full((4, 3), 1000, np.uint16)).save(tmp_path / "narrow.png")
    camera = Intrinsics(3, 4, 1.0, 1.0, 1.0, 1.5)
    assert read_cloud(tmp_path / "narrow.png", ReadOptions(intrinsics=camera)).shape == (4, 3, 3)


@pytest.mark.parametrize("name", ["a.png", "a.npy"])
def test_camera_errors_of_files_have_their_path(tmp_path: Path, valid: dict[str, bytes], name: str) -> None:
    path = tmp_path / name
    if name == "a.npy":
        np.save(path, np.tile(DEPTH_MM, (5, 1)))
    else:
        path.write_bytes(valid[".png"])
    with pytest.raises(CameraError) as caught:
        read_cloud(path)
    assert caught.value.path == path
    assert "intrinsics" in caught.value.suggestions


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.obj", b"v 1 2 3", "unknown file type"),
        ("a.mcap", b"1 2 3", "unknown file type"),
        ("a", b"1 2 3", "unknown file type"),
        ("a.pcd", b"", "empty"),
        ("a.npy", b"\x93NUMPY\x01\x00", "damaged"),
        ("a.npz", b"PK", "damaged"),
        ("a.xyz", b"\x89PNG\r\n", "has the columns"),
        ("a.xyz", b"\0" * 5000, "null bytes"),
        ("a.pcd", b"\x1f\x8b\x08 damaged", "gzip"),
    ],
)
def test_bad_files_are_read_errors(tmp_path: Path, name: str, data: bytes, reason: str) -> None:
    error = read_error(_write(tmp_path, name, data))
    assert reason in error.message
    assert (error.hint is not None) == name.endswith((".mcap", ".obj"))


def test_unprintable_characters_do_not_reach_the_terminal(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{"one\ntwo\x1b[31m": POINTS, "three": POINTS})
    assert "one two [31m, three" in str(read_error(tmp_path / "a.npz"))
    assert "new line.pcd" in str(read_error(tmp_path / "new\nline.pcd"))


def test_missing_files_folders_and_locked_files(tmp_path: Path) -> None:
    (tmp_path / "folder.pcd").mkdir()
    locked = _write(tmp_path, "locked.pcd", b"VERSION")
    locked.chmod(0)
    assert "No such file" in read_error(tmp_path / "absent.pcd").message
    assert "is a folder" in read_error(tmp_path / "folder.pcd").message
    if not os.access(locked, os.R_OK):  # root may read anything
        assert "Permission denied" in read_error(locked).message


@pytest.mark.parametrize("suffix", sorted(set(CLOUD_SUFFIXES) - {".png"}))
def test_files_packed_by_gzip(tmp_path: Path, valid: dict[str, bytes], suffix: str) -> None:
    packed = gzip.compress(valid[suffix])
    np.testing.assert_array_equal(read_cloud(_write(tmp_path, f"a{suffix}.gz", packed)), POINTS)
    np.testing.assert_array_equal(parse_cloud(packed, suffix), POINTS)
    assert "gzip" in read_error(_write(tmp_path, f"b{suffix}.GZ", packed[:-9])).message


def test_gzip_is_unpacked_up_to_a_limit_with_flat_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = gzip.compress(bytes(1 << 20)) * 257  # several members are one file
    assert unpack_at_most(packed, (1 << 20) + 5) == bytes((1 << 20) + 5)
    assert unpack_gzip(packed[: len(packed) // 257]) == bytes(1 << 20)
    tracemalloc.start()
    try:
        assert unpack_at_most(packed, 1000) == bytes(1000)
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak_bytes < 1e6
    monkeypatch.setattr("doorstate.io.formats.MAX_FILE_BYTES", 1000)
    monkeypatch.setattr("doorstate.io.size_limits.MAX_FILE_BYTES", 1000)
    with pytest.raises(CloudReadError, check=lambda error: error.expected == "at most 1000"):
        parse_cloud(gzip.compress(b"1 2 3\n" * 1000), ".xyz")


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_a_file_larger_than_the_limit_is_refused_before_it_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"large{suffix}"
    with path.open("wb") as stream:
        stream.truncate(200 << 30)
    link = tmp_path / f"zero{suffix}"
    link.symlink_to("/dev/zero")
    pipe = tmp_path / f"pipe{suffix}"
    os.mkfifo(pipe)
    tracemalloc.start()
    try:
        errors = [read_error(some) for some in (path, link, pipe)]
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak_bytes < 1e6
    assert errors[0].expected == f"at most {MAX_FILE_BYTES}"
    with pytest.raises(CloudReadError, check=lambda error: error.expected == f"at most {MAX_FILE_BYTES}"):
        parse_cloud(_Claims(b"1 2 3"), suffix)


class _Claims(bytes):
    """Bytes that claim to be too many."""

    def __len__(self) -> int:
        return MAX_FILE_BYTES + 1


@pytest.mark.parametrize("suffix", [".las", ".LAZ", ".e57", ".obj", ".jpg", ".mcap", ".doc"])
def test_files_of_other_formats_have_a_hint_how_to_convert_them(tmp_path: Path, suffix: str) -> None:
    error = read_error(_write(tmp_path, f"scan{suffix}", b"anything"))
    assert (error.hint is not None) == (suffix != ".doc")
    assert error.expected == " ".join(CLOUD_SUFFIXES)
    if error.hint and "python -c" in error.hint:
        code = error.hint.partition('python -c "')[2].removesuffix('"')
        compile(code, "hint", "exec")
        assert suffix.lower() in code


@pytest.mark.parametrize(
    ("data", "suffix"),
    [
        (b"# .PCD v.7 - Point Cloud Data file format\nVERSION .7\nFIELDS x", ".pcd"),
        (b"VERSION 0.7\r\n", ".pcd"),
        (b"ply\nformat", ".ply"),
        (b"1 2 3\n", None),
        (b"", None),
    ],
)
def test_formats_are_recognized_by_their_first_bytes(data: bytes, suffix: str | None) -> None:
    assert suffix_of_content(data) == suffix


def test_content_shows_every_binary_format(valid: dict[str, bytes]) -> None:
    for suffix, data in valid.items():
        assert suffix_of_content(data) == (None if suffix in (".xyz", ".txt", ".csv") else suffix)


def test_coordinates_as_rows_and_single_axes(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    np.save(tmp_path / "a.npy", points.T)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.npy"), points)
    np.save(tmp_path / "four.npy", np.vstack([points.T, np.ones(50, np.float32)]))
    assert read_error(tmp_path / "four.npy").suggestions == {"intrinsics": None}
    np.save(tmp_path / "channels.npy", np.zeros((3, 40, 50), np.float32))
    assert read_error(tmp_path / "channels.npy").hint is not None
    expected = depth_to_points(np.full((4, 20), 1.25), CAMERA)
    for shape in ((1, 4, 20), (4, 20, 1)):
        np.save(tmp_path / "depth.npy", np.full(shape, 1.25, np.float32))
        points = read_cloud(tmp_path / "depth.npy", ReadOptions(intrinsics=CAMERA))
        np.testing.assert_array_equal(points, expected)


@pytest.mark.parametrize("shape", [(), (5,), (5, 2), (0, 0), (2, 2, 2), (2, 2, 2, 3), (2, 2, 40)])
def test_arrays_of_another_shape_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    np.save(tmp_path / "a.npy", np.zeros(shape, np.float32))
    assert str(shape) in read_error(tmp_path / "a.npy").message


_HUGE = 10**12
_PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS {n}\nDATA {kind}\n"
_PACKED_SIZES = (12).to_bytes(4, "little") + (3_600_000_000).to_bytes(4, "little")
_PLY = PLY_HEADER.replace(b"vertex 4", b"vertex %d" % _HUGE) + b"end_header\n"
_NPY = saved(lambda stream: np.save(stream, np.zeros((4, 3))))
FALSE_SIZES = {
    "ascii.pcd": _PCD.format(n=_HUGE, kind="ascii").encode(),
    "binary.pcd": _PCD.format(n=_HUGE, kind="binary").encode(),
    "compressed.pcd": _PCD.format(n=_HUGE, kind="binary_compressed").encode(),
    "packed.pcd": _PCD.format(n=300_000_000, kind="binary_compressed").encode() + _PACKED_SIZES,
    "count.pcd": _PCD.format(n=1, kind="binary").replace("COUNT 1", f"COUNT {_HUGE}").encode(),
    "binary.ply": _PLY,
    "ascii.ply": _PLY.replace(b"binary_little_endian", b"ascii"),
    "array.npy": _NPY.replace(b"(4, 3), ", b"(9999999999, 3), "),
}


@pytest.mark.parametrize("name", FALSE_SIZES)
def test_a_declared_size_is_checked_before_anything_is_allocated(tmp_path: Path, name: str) -> None:
    path = _write(tmp_path, name, FALSE_SIZES[name] + b"1 2 3\n" * 20)
    tracemalloc.start()
    try:
        with pytest.raises(CloudReadError):
            read_cloud(path)
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak_bytes < 4e6


@pytest.mark.parametrize("shape", [(0, 10**9, 3), (10**9, 0, 3), (0, 4)])
def test_shapes_without_points_are_empty_clouds(shape: tuple[int, ...]) -> None:
    header = str({"descr": "<f4", "fortran_order": False, "shape": shape}).encode()
    data = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    assert parse_cloud(data, ".npy", ReadOptions(roll_deg=90)).shape == (0, 3)


def test_long_errors_are_shortened() -> None:
    header = b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"property float w\n" * 10_000 + b"end_header\n"
    with pytest.raises(CloudReadError) as caught:
        parse_cloud(header, ".ply")
    assert len(str(caught.value)) == MAX_MESSAGE_LENGTH


@pytest.mark.parametrize("suffix", [".npz", ".png", ".pcd"])
def test_files_that_unpack_to_too_many_points_are_refused(suffix: str) -> None:
    packed = bomb(suffix, MAX_POINTS + 4096)
    tracemalloc.start()
    try:
        with pytest.raises(CloudReadError, match=str(MAX_POINTS + 4096)):
            parse_cloud(packed, suffix, ReadOptions(intrinsics=Pinhole(1, 1, 0, 0)))
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    # The size of an archive is only known when it is unpacked: 12 bytes per point, twice.
    assert peak_bytes < (220e6 if suffix == ".npz" else 30e6)


def test_libraries_do_not_warn_or_print(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # numpy warns about a table without rows, and about a number too large for float32.
    hollow = _write(tmp_path, "hollow.pcd", _PCD.format(n=1, kind="ascii") + "# nothing\n")
    huge = _write(tmp_path, "huge.xyz", "1e300 2 3\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(CloudReadError):
            read_cloud(hollow)
        assert np.isinf(read_cloud(huge)[0, 0])
    assert [str(warning.message) for warning in caught] == []
    assert capfd.readouterr() == ("", "")
