# SPDX-License-Identifier: Apache-2.0
"""The one door for files: every format in one frame, every bad file one line."""

from __future__ import annotations

import os
import tracemalloc
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.mutations import EDITS, TOKENS, Edit, bomb, mutate, saved
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from doorstate.errors import MAX_MESSAGE_LENGTH, CameraError, CloudError, CloudReadError
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.pcd import write_pcd
from doorstate.io.readers import (
    CLOUD_SUFFIXES,
    ReadOptions,
    find_clouds,
    parse_cloud,
    points_from_depth,
    points_in_body,
    read_cloud,
)
from doorstate.io.size_limits import MAX_POINTS

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


def _one_line(error: Exception, path: Path) -> bool:
    return str(error).startswith(f"{path.name}: ") and "\n" not in str(error)


@pytest.mark.parametrize("suffix", sorted(set(CLOUD_SUFFIXES) - {".png"}))
@pytest.mark.parametrize("shout", [False, True])
def test_every_suffix_gives_the_same_points(
    tmp_path: Path, valid: dict[str, bytes], suffix: str, shout: bool
) -> None:
    points = read_cloud(_write(tmp_path, "a" + (suffix.upper() if shout else suffix), valid[suffix]))
    assert points.dtype == np.float32
    np.testing.assert_array_equal(points, POINTS)


def test_frame_units_and_roll_of_a_cloud(tmp_path: Path) -> None:
    # Optical millimetres: 2 m ahead, 1 m to the left, 0.5 m above the axis.
    path = _write(tmp_path, "a.xyz", "-1000 -500 2000\n")
    options = ReadOptions(frame="optical", units_m=0.001)
    assert read_cloud(path, options).tolist() == [[2.0, 1.0, 0.5]]
    # The camera was turned clockwise by 90 degrees: its left is up, its up is right.
    turned = ReadOptions(frame="optical", units_m=0.001, roll_deg=90)
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
def test_a_depth_image_is_read_from_every_container(tmp_path: Path, name: str, roll_deg: int) -> None:
    path = tmp_path / name
    match path.suffix:
        case ".png":
            Image.fromarray(DEPTH_MM).save(path)
        case ".npy":
            np.save(path, DEPTH_MM.astype(">u2") if "big" in name else DEPTH_MM)
        case ".npz":
            np.savez(path, depth=DEPTH_MM, other=np.zeros(3))
    depth_m = DEPTH_MM / 1000
    depth_m[1, 2:4] = NAN  # 0 and 65535 both mean that nothing came back
    points = read_cloud(path, ReadOptions(intrinsics=CAMERA, roll_deg=roll_deg, frame="optical"))
    np.testing.assert_array_equal(points, depth_to_points(depth_m, CAMERA, roll_deg))
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(points[..., 0])), [22, 23])


def test_the_scale_of_stored_depth(tmp_path: Path) -> None:
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


def test_depth_without_a_camera_names_the_flags(tmp_path: Path, valid: dict[str, bytes]) -> None:
    path = _write(tmp_path, "a.png", valid[".png"])
    with pytest.raises(CameraError, match=r"20 x 4 .*--intrinsics FILE or --fx --fy --cx --cy") as caught:
        read_cloud(path)
    assert _one_line(caught.value, path)


def test_a_pinhole_takes_every_image_size(tmp_path: Path) -> None:
    path = _write(tmp_path, "depth.png", saved(lambda f: Image.fromarray(DEPTH_MM).save(f, "PNG")))
    pinhole = Pinhole(CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    exact = read_cloud(path, ReadOptions(intrinsics=CAMERA))
    np.testing.assert_array_equal(read_cloud(path, ReadOptions(intrinsics=pinhole)), exact)


def test_a_pinhole_of_another_resolution_is_refused(tmp_path: Path) -> None:
    path = _write(tmp_path, "depth.png", saved(lambda f: Image.fromarray(DEPTH_MM).save(f, "PNG")))
    of_double_size = Pinhole(2 * CAMERA.fx, 2 * CAMERA.fy, 2 * CAMERA.cx, 2 * CAMERA.cy)
    with pytest.raises(CameraError, match="of another resolution") as caught:
        read_cloud(path, ReadOptions(intrinsics=of_double_size))
    assert _one_line(caught.value, path)


def test_units_of_clouds_are_not_passed_over_by_integer_depth(tmp_path: Path) -> None:
    np.save(tmp_path / "depth.npy", DEPTH_MM)
    centimetres = ReadOptions(intrinsics=CAMERA, units_m=0.01)
    with pytest.raises(CameraError, match=r"integer depth is not in --units: say --depth-scale 0\.01"):
        read_cloud(tmp_path / "depth.npy", centimetres)
    assert read_cloud(tmp_path / "depth.npy", replace(centimetres, depth_scale_m=0.01)).ndim == 3


@pytest.mark.parametrize(
    "impossible",
    [
        {"roll_deg": 45},
        {"frame": "sideways"},
        {"units_m": 0.0},
        {"depth_scale_m": np.nan},
        {"intrinsics": Pinhole(-5, 5, 2, 2)},
        {"intrinsics": "camera.yaml"},
    ],
)
def test_impossible_options_are_refused_before_a_file_is_read(impossible: dict[str, Any]) -> None:
    with pytest.raises(CameraError):
        ReadOptions(**impossible)


def test_depth_of_another_size_names_both_sizes(tmp_path: Path, valid: dict[str, bytes]) -> None:
    path = _write(tmp_path, "a.png", valid[".png"])
    with pytest.raises(CameraError, match=r"20 x 4 .* 640 x 480") as caught:
        read_cloud(path, ReadOptions(intrinsics=Intrinsics.from_hfov(640, 480, 1.0)))
    assert _one_line(caught.value, path)


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.obj", b"v 1 2 3", "unknown file type; clouds are "),
        ("a.mcap", b"1 2 3", "a recording: give it by --bag"),
        ("a", b"1 2 3", "unknown file type"),
        ("a.pcd", b"", r"empty \(0 bytes\)"),
        ("a.npy", b"\x93NUMPY\x01\x00", "damaged, or no .npy file"),
        ("a.npz", b"PK", "damaged, or no .npz file"),
        ("a.xyz", b"\x89PNG\r\n", "damaged, or no .xyz file"),
    ],
)
def test_a_bad_file_gives_one_line_that_starts_with_its_name(
    tmp_path: Path, name: str, data: bytes, reason: str
) -> None:
    path = _write(tmp_path, name, data)
    with pytest.raises(CloudReadError, match=reason) as caught:
        read_cloud(path)
    assert _one_line(caught.value, path)


def test_names_in_files_break_no_line_and_reach_no_terminal(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{"one\ntwo\x1b[31m": POINTS, "three": POINTS})
    with pytest.raises(CloudReadError, match=r"^a.npz: holds one two \[31m, three: name the array"):
        read_cloud(tmp_path / "a.npz")
    with pytest.raises(CloudReadError, match=r"^new line.pcd: cannot be read"):
        read_cloud(tmp_path / "new\nline.pcd")


def test_a_missing_file_a_folder_and_a_locked_file(tmp_path: Path) -> None:
    (tmp_path / "folder.pcd").mkdir()
    locked = _write(tmp_path, "locked.pcd", b"VERSION")
    locked.chmod(0)
    for name, reason in (("absent.pcd", "No such file"), ("folder.pcd", "is a folder")):
        with pytest.raises(CloudReadError, match=f"^{name}: .*{reason}"):
            read_cloud(tmp_path / name)
    if not os.access(locked, os.R_OK):  # root may read anything
        with pytest.raises(CloudReadError, match="Permission denied"):
            read_cloud(locked)


@pytest.mark.parametrize("shape", [(), (5,), (5, 2), (0, 0), (2, 2, 2), (2, 2, 2, 3), (2, 2, 40)])
def test_other_shapes_are_named(tmp_path: Path, shape: tuple[int, ...]) -> None:
    np.save(tmp_path / "a.npy", np.zeros(shape, np.float32))
    with pytest.raises(CloudReadError, match="holds shape"):
        read_cloud(tmp_path / "a.npy")


@pytest.mark.parametrize(
    "settings_", [{"units_m": 0}, {"units_m": NAN}, {"depth_scale_m": -0.001}, {"frame": "camera"}]
)
def test_impossible_options_are_camera_errors(settings_: dict[str, Any]) -> None:
    with pytest.raises(CameraError):
        ReadOptions(**settings_)


def test_a_roll_that_is_no_quarter_turn_is_a_camera_error(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="45 degrees"):
        read_cloud(_write(tmp_path, "a.xyz", "1 2 3"), ReadOptions(roll_deg=45))


_HUGE = 10**12
_PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS {n}\nDATA {kind}\n"
_PACKED_SIZES = (12).to_bytes(4, "little") + (3_600_000_000).to_bytes(4, "little")
_PLY = PLY_HEADER.replace(b"vertex 4", b"vertex %d" % _HUGE) + b"end_header\n"
_NPY = saved(lambda stream: np.save(stream, np.zeros((4, 3))))
LIARS = {
    "ascii.pcd": _PCD.format(n=_HUGE, kind="ascii").encode(),
    "binary.pcd": _PCD.format(n=_HUGE, kind="binary").encode(),
    "compressed.pcd": _PCD.format(n=_HUGE, kind="binary_compressed").encode(),
    "packed.pcd": _PCD.format(n=300_000_000, kind="binary_compressed").encode() + _PACKED_SIZES,
    "count.pcd": _PCD.format(n=1, kind="binary").replace("COUNT 1", f"COUNT {_HUGE}").encode(),
    "binary.ply": _PLY,
    "ascii.ply": _PLY.replace(b"binary_little_endian", b"ascii"),
    "array.npy": _NPY.replace(b"(4, 3), ", b"(9999999999, 3), "),
}


@pytest.mark.parametrize("name", LIARS)
def test_a_declared_size_is_checked_before_anything_is_allocated(tmp_path: Path, name: str) -> None:
    path = _write(tmp_path, name, LIARS[name] + b"1 2 3\n" * 20)
    tracemalloc.start()
    try:
        with pytest.raises(CloudReadError):
            read_cloud(path)
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak_bytes < 4e6


_contents = st.binary(min_size=1, max_size=4) | st.sampled_from(TOKENS)
_edits = st.lists(
    st.tuples(st.sampled_from(EDITS), st.integers(0, 1000), _contents),
    min_size=1,
    max_size=4,
)


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
@given(edits=_edits, noise=st.none() | st.binary(max_size=200))
@settings(deadline=None, max_examples=150)
def test_damaged_files_are_read_or_are_cloud_errors(
    tmp_path_factory: pytest.TempPathFactory,
    valid: dict[str, bytes],
    suffix: str,
    edits: list[Edit],
    noise: bytes | None,
) -> None:
    path = tmp_path_factory.getbasetemp() / f"fuzz{suffix}"
    path.write_bytes(mutate(valid[suffix], edits) if noise is None else noise)
    for options in (ReadOptions(), ReadOptions(intrinsics=CAMERA, frame="optical", roll_deg=90)):
        outcome = _points_or_error(path, options)
        if isinstance(outcome, Exception):
            assert _one_line(outcome, path)
        else:
            assert outcome.dtype == np.float32
            assert outcome.ndim in (2, 3)
            assert outcome.shape[-1] == 3


@pytest.mark.parametrize("shape", [(0, 10**9, 3), (10**9, 0, 3), (0, 4)])
def test_a_cloud_without_points_has_no_size(shape: tuple[int, ...]) -> None:
    header = str({"descr": "<f4", "fortran_order": False, "shape": shape}).encode()
    data = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    assert parse_cloud(data, ".npy", ReadOptions(roll_deg=90)).shape == (0, 3)


def test_a_million_names_are_no_line() -> None:
    header = b"ply\nformat ascii 1.0\nelement vertex 1\n" + b"property float w\n" * 10_000 + b"end_header\n"
    with pytest.raises(CloudReadError, match=r"has vertices of w, w, .*\.\.\.$") as caught:
        parse_cloud(header, ".ply")
    assert len(str(caught.value)) == MAX_MESSAGE_LENGTH


@pytest.mark.parametrize("suffix", [".npz", ".png", ".pcd"])
def test_what_unpacks_to_more_than_a_camera_has_is_refused(suffix: str) -> None:
    packed = bomb(suffix, MAX_POINTS + 4096)
    tracemalloc.start()
    try:
        with pytest.raises(CloudReadError, match=f"holds {MAX_POINTS + 4096} points: not one camera frame"):
            parse_cloud(packed, suffix, ReadOptions(intrinsics=Pinhole(1, 1, 0, 0)))
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    # An archive only tells when it is unpacked: 12 bytes a point, twice.
    assert peak_bytes < (220e6 if suffix == ".npz" else 30e6)


def _points_or_error(path: Path, options: ReadOptions) -> NDArray[np.float32] | CloudError | CameraError:
    try:
        return read_cloud(path, options)
    except (CloudError, CameraError) as error:
        return error


def test_what_libraries_say_does_not_leak(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # numpy warns of a table without rows, and of a number too large for float32.
    hollow = _write(tmp_path, "hollow.pcd", _PCD.format(n=1, kind="ascii") + "# nothing\n")
    huge = _write(tmp_path, "huge.xyz", "1e300 2 3\n")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(CloudReadError):
            read_cloud(hollow)
        assert np.isinf(read_cloud(huge)[0, 0])
    assert [str(warning.message) for warning in caught] == []
    assert capfd.readouterr() == ("", "")


def test_signalling_nan_and_overflow_are_no_return_and_no_warning() -> None:
    signalling = np.full((4, 20), 0x7FA00000, np.uint32).view(np.float32)
    for stored in (signalling, np.full((4, 20), 3e38, np.float32)):
        depth = points_from_depth(stored, ReadOptions(intrinsics=CAMERA, units_m=1000.0))
        assert not np.isfinite(depth).any()
        assert not np.isfinite(points_in_body(stored[:, :3], ReadOptions(units_m=1000.0))).any()


def test_find_clouds_takes_files_as_given_and_searches_folders(tmp_path: Path) -> None:
    for name in ("10.pcd", "2.PCD", "b/1.ply", "b/a_rgb.png", "b/A_RGB.PNG", "b/a.png", "b/notes.md"):
        _write(tmp_path, f"scans/{name}", b"-")
    for name in (".hidden.pcd", ".cache/1.pcd"):
        _write(tmp_path, f"scans/{name}", b"-")
    (tmp_path / "scans" / "folder.pcd").mkdir()
    given_file = _write(tmp_path, "odd.suffix", b"-")
    found = find_clouds([given_file, tmp_path / "scans", given_file])
    assert [path.relative_to(tmp_path).as_posix() for path in found] == [
        "odd.suffix", "scans/2.PCD", "scans/10.pcd", "scans/b/1.ply", "scans/b/a.png", "odd.suffix",
    ]  # fmt: skip


def test_a_folder_below_a_hidden_one_is_not_hidden(tmp_path: Path) -> None:
    path = _write(tmp_path, ".data/scan.pcd", b"-")
    assert find_clouds([path.parent]) == [path]


def test_find_clouds_names_what_is_missing_or_empty(tmp_path: Path) -> None:
    _write(tmp_path, "pictures/a_rgb.png", b"-")
    with pytest.raises(CloudReadError, match=r"absent: no such file"):
        find_clouds([tmp_path / "absent"])
    with pytest.raises(CloudReadError, match=r"pictures: no clouds"):
        find_clouds([tmp_path / "pictures"])
    assert find_clouds([]) == []


def test_tables_about_clouds_are_none_and_prepared_data_sets_are_shown_by_view(tmp_path: Path) -> None:
    for name in ("a.pcd", "index.csv", "manifest.csv", "predictions.csv", "rejected.csv", "points.csv"):
        (tmp_path / name).touch()
    assert [path.name for path in find_clouds([tmp_path])] == ["a.pcd", "points.csv"]
    assert find_clouds([tmp_path / "index.csv"]) == [tmp_path / "index.csv"], "as given"
    (tmp_path / "dataset.json").touch()
    with pytest.raises(CloudReadError, match="a prepared data set: doorstate view shows it"):
        find_clouds([tmp_path])


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=6, unique=True), st.randoms())
@settings(deadline=None, max_examples=20)
def test_numbers_in_names_count(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[int], random: Any
) -> None:
    folder = tmp_path_factory.mktemp("order")
    random.shuffle(numbers)
    for number in numbers:
        _write(folder, f"frame{number}.pcd", b"-")
    assert find_clouds([folder]) == [folder / f"frame{number}.pcd" for number in sorted(numbers)]
