# SPDX-License-Identifier: Apache-2.0
"""ROS 1 and ROS 2 bags written by rosbags: frames, cameras, stamps, topics; damaged bags."""

from __future__ import annotations

import io
import os
import struct
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

pytest.importorskip("rosbags")

from doorstate.errors import CameraError, CloudReadError, DoorstateError, MissingExtraError
from doorstate.io.bags import BagTopic, StampedCloud, open_bag
from doorstate.io.camera import Intrinsics, Pinhole
from doorstate.io.depth import depth_to_points
from doorstate.io.distortion import Distortion
from doorstate.io.options import ReadOptions
from tests.bag_writer import (
    KINDS,
    START_NS,
    Message,
    camera_info,
    cloud,
    compressed_image,
    image,
    text,
    write_bag,
    write_mcap,
)
from tests.error_fields import about
from tests.rvl import encode

ORGANIZED = np.random.default_rng(0).normal(2, 1, (6, 8, 3)).astype(np.float32)
ORGANIZED[1, 2] = np.nan
DEPTH_MM = np.random.default_rng(1).integers(500, 4000, (6, 8), dtype=np.uint16)
DEPTH_MM[0, :2] = (0, 65535)
DEPTH_M = np.where((DEPTH_MM == 0) | (DEPTH_MM == 65535), np.nan, DEPTH_MM / 1000)
CAMERA = Intrinsics(8, 6, 7.0, 7.5, 3.5, 2.5)
K = (7, 0, 3.5, 0, 7.5, 2.5, 0, 0, 1)
P = (7, 0, 3.5, 0, 0, 7.5, 2.5, 0, 0, 0, 1, 0)
INFO = camera_info("/depth/camera_info", 8, 6, K, P)
PNG_PARAMETERS = struct.pack("<iff", 0, 0, 0)


def read(
    path: Path, name: str | None = None, options: ReadOptions | None = None, **more: Any
) -> list[StampedCloud]:
    with open_bag(path) as bag:
        return list(bag.clouds(bag.choose(name), options or ReadOptions(), **more))


def read_one(path: Path, options: ReadOptions | None = None, **more: Any) -> NDArray[np.float32]:
    (only,) = read(path, None, options, **more)
    if isinstance(only.cloud, DoorstateError):
        raise only.cloud
    return only.cloud


def read_error(path: Path, name: str | None = None) -> DoorstateError:
    """Return the error of a bag or a file in it, after checking that it is one line."""
    with pytest.raises(DoorstateError) as caught:
        read(path, name)
    place = Path(caught.value.path or "")
    assert path in (place, *place.parents)
    assert str(caught.value).isprintable()
    return caught.value


def png(pixels: NDArray[np.uint16]) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_clouds_are_read_in_order_with_their_stamps(kind: str, tmp_path: Path) -> None:
    flat = ORGANIZED.reshape(-1, 3)
    messages = [
        cloud("/points", ORGANIZED, START_NS + 100_000_000),
        text("/chatter"),
        cloud("/flat", flat),
        cloud("/points", ORGANIZED + 1, START_NS + 200_000_000),
    ]
    path = write_bag(tmp_path, kind, messages)
    with open_bag(path) as bag:
        assert bag.topics == [
            BagTopic("/chatter", "std_msgs/msg/String", 1),
            BagTopic("/flat", "sensor_msgs/msg/PointCloud2", 1),
            BagTopic("/points", "sensor_msgs/msg/PointCloud2", 2),
        ]
    first, second = read(path, "/points")
    assert (first.stamp_s, second.stamp_s) == (1_700_000_000.1, 1_700_000_000.2)
    assert first.frame_id == "camera_link"
    np.testing.assert_array_equal(first.cloud, ORGANIZED)
    np.testing.assert_array_equal(second.cloud, ORGANIZED + 1)
    np.testing.assert_array_equal(read(path, "/flat")[0].cloud, flat)


@pytest.mark.parametrize(
    ("profile", "encoding"), [("ros1", "ros1"), ("", "ros1"), ("ros2", "cdr"), ("", "cdr")]
)
def test_mcap_files_of_every_profile(profile: str, encoding: str, tmp_path: Path) -> None:
    messages = [cloud("/points", ORGANIZED, START_NS + 1), text("/chatter")]
    path = write_mcap(tmp_path / "a.mcap", messages, profile, encoding)
    with open_bag(path) as bag:
        assert bag.topics[1] == BagTopic("/points", "sensor_msgs/msg/PointCloud2", 1)
    (stamped,) = read(path)
    assert stamped.stamp_s == (START_NS + 1) / 1e9
    np.testing.assert_array_equal(stamped.cloud, ORGANIZED)


def test_mcap_messages_of_other_encodings_are_named(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", [cloud("/points", ORGANIZED)], "", "protobuf")
    assert "protobuf" in read_error(path, "/points").message
    path = write_mcap(tmp_path / "b.mcap", [cloud("/points", ORGANIZED)], "other", "cdr")
    assert "rofile" in read_error(path).message


def test_bags_are_regular_files(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.bag")
    (tmp_path / "zero.mcap").symlink_to("/dev/zero")
    for name in ("pipe.bag", "zero.mcap"):
        read_error(tmp_path / name)
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED)])
    (link := tmp_path / "linked").mkdir()
    folder = folder.rename(link / "content")
    for file in folder.iterdir():
        (link / file.name).symlink_to(file)
    np.testing.assert_array_equal(read_one(link), ORGANIZED)
    (database,) = link.glob("*.db3")
    database.unlink()
    os.mkfifo(database)
    with pytest.raises(CloudReadError, check=about(database)):
        read(link)


def test_a_large_metadata_file_is_refused_at_once(tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED)])
    with (folder / "metadata.yaml").open("a") as stream:
        stream.write("# more\n" * 300_000)
    started = time.process_time()
    with pytest.raises(CloudReadError, check=about(folder / "metadata.yaml")):
        read(folder)
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_one_file_of_a_ros2_folder_is_enough(kind: str, tmp_path: Path) -> None:
    folder = write_bag(tmp_path, kind, [cloud("/points", ORGANIZED)])
    (folder / "metadata.yaml").unlink()
    np.testing.assert_array_equal(read_one(folder / f"{folder.name}.{kind}"), ORGANIZED)
    assert "metadata.yaml" in read_error(folder).message


COMPRESSED = [("bag", "LZ4"), ("bag", "BZ2"), ("db3", "MESSAGE"), ("mcap", "STORAGE")]


@pytest.mark.parametrize(("kind", "compression"), [*COMPRESSED, ("db3", "FILE")])
def test_compressed_bags_are_read(kind: str, compression: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path, kind, [cloud("/points", ORGANIZED)], compression)
    np.testing.assert_array_equal(read_one(path), ORGANIZED)


def test_one_file_of_a_folder_with_compressed_messages_is_enough(tmp_path: Path) -> None:
    folder = write_bag(tmp_path, "db3", [cloud("/points", ORGANIZED)], "MESSAGE")
    np.testing.assert_array_equal(read_one(folder / f"{folder.name}.db3"), ORGANIZED)


def test_zero_stamps_are_replaced_by_the_time_of_recording(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", [cloud("/points", ORGANIZED, 0)])
    assert read(path)[0].stamp_s == 0.001


def test_every_third_message(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "bag", [cloud("/points", ORGANIZED, START_NS + i * 10**9) for i in range(8)])
    assert [stamped.stamp_s - START_NS / 1e9 for stamped in read(path, every=3)] == [0, 3, 6]


def test_frame_roll_and_units_are_those_of_files(tmp_path: Path) -> None:
    right, down, forward = 100.0, 200.0, 3000.0  # millimetres, of a camera turned clockwise
    path = write_bag(tmp_path, "mcap", [cloud("/points", np.array([[right, down, forward]]))])
    upright = read_one(path, ReadOptions(axes="optical", units_m=0.001))
    np.testing.assert_allclose(upright, [[3, -0.1, -0.2]], rtol=1e-6)
    turned = read_one(path, ReadOptions(axes="optical", units_m=0.001, roll_deg=90))
    np.testing.assert_allclose(turned, [[3, 0.2, -0.1]], rtol=1e-6)


@pytest.mark.parametrize(
    ("kind", "pixels", "encoding"),
    [
        ("bag", DEPTH_MM, "16UC1"),
        ("db3", DEPTH_MM.astype(">u2"), "mono16"),
        ("mcap", DEPTH_M.astype("<f4"), "32FC1"),
        ("bag", DEPTH_M.astype(">f4"), "32FC1"),
    ],
)
def test_depth_images_take_the_camera_beside_them(
    kind: str, pixels: NDArray[Any], encoding: str, tmp_path: Path
) -> None:
    path = write_bag(tmp_path, kind, [image("/depth/image_raw", pixels, encoding), INFO])
    points = read_one(path)
    np.testing.assert_allclose(points, depth_to_points(DEPTH_M, CAMERA), rtol=1e-6)
    assert np.isnan(points[0, :2]).all()


def test_rows_of_images_may_be_padded_and_scales_and_roll_are_taken(tmp_path: Path) -> None:
    padded = np.pad(DEPTH_MM, ((0, 0), (0, 2)))
    message = image("/depth/image_raw", padded, "16UC1", width=8)
    path = write_bag(tmp_path, "mcap", [message, INFO])
    points = read_one(path, ReadOptions(depth_scale_m=0.01, roll_deg=270))
    np.testing.assert_allclose(points, depth_to_points(DEPTH_M * 10, CAMERA, 270), rtol=1e-6)


def test_cameras_of_another_topic_and_of_the_options(tmp_path: Path) -> None:
    other = camera_info("/other", 8, 6, (9, 0, 3, 0, 9, 2, 0, 0, 1), [0] * 12)
    path = write_bag(tmp_path, "mcap", [image("/depth/image_raw", DEPTH_MM, "16UC1"), INFO, other])
    with_k = depth_to_points(DEPTH_M, Intrinsics(8, 6, 9, 9, 3, 2))
    np.testing.assert_allclose(read_one(path, camera_info_topic="/other"), with_k, rtol=1e-6)
    for camera in (Pinhole(9, 9, 3, 2), Intrinsics(8, 6, 9, 9, 3, 2)):
        np.testing.assert_allclose(read_one(path, ReadOptions(intrinsics=camera)), with_k, rtol=1e-6)


def test_rectified_images_are_of_the_camera_p(tmp_path: Path) -> None:
    info = camera_info("/depth/camera_info", 8, 6, K, (5, 0, 1, -0.3, 0, 6, 2, 0, 0, 0, 1, 0))
    path = write_bag(tmp_path, "bag", [image("/depth/image_rect", DEPTH_MM, "16UC1"), info])
    np.testing.assert_allclose(
        read_one(path), depth_to_points(DEPTH_M, Intrinsics(8, 6, 5, 6, 1, 2)), rtol=1e-6
    )


@pytest.mark.parametrize("kind", ["bag", "mcap"])
@pytest.mark.parametrize("topic", ["/depth/image_raw", "/depth/image_rect", "/depth/image"])
def test_the_first_good_camera_counts_and_images_are_rectified_by_their_topic(
    topic: str, kind: str, tmp_path: Path
) -> None:
    zeros = camera_info("/depth/camera_info", 8, 6, [0] * 9, [0] * 12)
    good = camera_info("/depth/camera_info", 8, 6, K, (5, 0, 1, -0.3, 0, 6, 2, 0, 0, 0, 1, 0), START_NS + 1)
    good.fields["d"] = np.array([-0.2, 0.1, 0, 0, 0])
    later = camera_info("/depth/camera_info", 8, 6, (9, 0, 3, 0, 9, 2, 0, 0, 1), [0] * 12, START_NS + 2)
    path = write_bag(tmp_path, kind, [zeros, image(topic, DEPTH_MM, "16UC1"), good, later])
    raw = replace(CAMERA, distortion=Distortion("plumb_bob", (-0.2, 0.1, 0, 0, 0)))
    rectified = Intrinsics(8, 6, 5, 6, 1, 2)
    expected = raw if topic.endswith("raw") else rectified
    np.testing.assert_allclose(read_one(path), depth_to_points(DEPTH_M, expected), rtol=1e-6)
    for given, camera in ((True, rectified), (False, raw)):
        points = read_one(path, ReadOptions(rectified=given))
        np.testing.assert_allclose(points, depth_to_points(DEPTH_M, camera), rtol=1e-6)


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_compressed_depth_of_integers_is_lossless(kind: str, tmp_path: Path) -> None:
    message = compressed_image(
        "/depth/image_raw/compressedDepth", PNG_PARAMETERS + png(DEPTH_MM), "16UC1; compressedDepth png"
    )
    path = write_bag(tmp_path, kind, [message, INFO])
    np.testing.assert_allclose(read_one(path), depth_to_points(DEPTH_M, CAMERA), rtol=1e-6)


@pytest.mark.parametrize(
    ("data", "image_format"),
    [
        (PNG_PARAMETERS + encode(DEPTH_MM), "16UC1; compressedDepth rvl"),
        (PNG_PARAMETERS + png(DEPTH_MM), "16UC1; compressedDepth rvl"),  # some drivers name RVL and write PNG
        (PNG_PARAMETERS + png(DEPTH_MM), "16UC1; compressedDepth"),
        (png(DEPTH_MM), "16UC1; png compressed "),
    ],
)
def test_other_forms_of_compressed_depth(data: bytes, image_format: str, tmp_path: Path) -> None:
    message = compressed_image("/depth/image_raw/compressedDepth", data, image_format)
    path = write_bag(tmp_path, "mcap", [message, INFO])
    np.testing.assert_allclose(read_one(path), depth_to_points(DEPTH_M, CAMERA), rtol=1e-6)


def test_compressed_depth_of_floats_is_inverse(tmp_path: Path) -> None:
    # As compressed_depth_image_transport packs it: a = q (q + 1), b = 1 - a / farthest, stored = a / depth + b.
    quant_a = 100.0 * 101.0
    quant_b = 1 - quant_a / 10.0
    stored = np.where(np.isfinite(DEPTH_M), quant_a / DEPTH_M + quant_b, 0).astype(np.uint16)
    data = struct.pack("<iff", 0, quant_a, quant_b) + png(stored)
    message = compressed_image("/depth/image_raw/compressedDepth", data, "32FC1; compressedDepth")
    points = read_one(write_bag(tmp_path, "mcap", [message, INFO]))
    np.testing.assert_allclose(points[..., 0], DEPTH_M, rtol=2e-3)


def test_a_bag_with_one_usable_topic_needs_no_name(tmp_path: Path) -> None:
    colour = image("/colour/image_raw", np.zeros((6, 24), np.uint8), "rgb8", width=8)
    jpeg = compressed_image("/colour/image_raw/compressed", b"\xff\xd8", "rgb8; jpeg compressed bgr8")
    path = write_bag(tmp_path, "mcap", [colour, jpeg, text("/chatter"), cloud("/points", ORGANIZED)])
    np.testing.assert_array_equal(read_one(path), ORGANIZED)
    for name, reason in (
        ("/gone", "/gone"),
        ("/chatter", "String"),
        ("/colour/image_raw", "rgb8"),
        ("/colour/image_raw/compressed", "jpeg"),
    ):
        error = read_error(path, name)
        assert (error.field, error.expected) == ("topic", "/points (PointCloud2, 1)")
        assert reason in error.message


def test_several_usable_topics_are_listed(tmp_path: Path) -> None:
    depth = image("/depth/image_raw", DEPTH_MM, "16UC1")
    error = read_error(write_bag(tmp_path, "bag", [cloud("/points", ORGANIZED), depth, INFO]))
    assert error.field == "topic"
    assert error.expected == "/depth/image_raw (Image, 1), /points (PointCloud2, 1)"


def test_bags_without_readable_topics_are_errors(tmp_path: Path) -> None:
    zstd = compressed_image("/depth/compressedDepth", b"", "16UC1; compressedDepth zstd")
    path = write_bag(tmp_path, "mcap", [text("/chatter"), zstd])
    assert (read_error(path).field, read_error(path).expected) == ("topic", None)
    assert "zstd" in read_error(path, "/depth/compressedDepth").message


@pytest.mark.parametrize(
    ("info", "reason"),
    [
        (text("/depth/camera_info"), "no CameraInfo in /depth/camera_info"),
        (camera_info("/elsewhere/camera_info", 8, 6, K, P), "no CameraInfo in /depth/camera_info"),
        (camera_info("/depth/camera_info", 8, 6, [0] * 9, [0] * 12), "/depth/camera_info: .* not calibrated"),
    ],
)
def test_depth_images_without_a_camera_are_camera_errors(info: Message, reason: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path, "mcap", [image("/depth/image_raw", DEPTH_MM, "16UC1"), info])
    with pytest.raises(CameraError, match=reason):
        read(path)


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (cloud("/t", ORGANIZED, START_NS, point_step=0), "not within 0 bytes a point"),
        (cloud("/t", ORGANIZED, START_NS, height=2**32 - 1), "not one camera frame"),
        (image("/t", DEPTH_MM, "rgb8"), "is an image in rgb8"),
        (
            image("/t", DEPTH_MM, "16UC1", START_NS, height=7),
            "112 bytes are declared",
        ),
        (image("/t", DEPTH_MM, "16UC1", START_NS, step=15), "6 rows of 8 pixels"),
        (image("/t", DEPTH_MM, "16UC1", START_NS, height=0), "is damaged: 0 rows"),
        (image("/t", DEPTH_MM[:, :4], "16UC1", START_NS), "the image has 4 x 6 pixels"),
        (compressed_image("/t", b"short", "16UC1; compressedDepth", START_NS), "is not a PNG"),
        (
            compressed_image("/t", PNG_PARAMETERS + png(DEPTH_MM)[:-40], "16UC1; compressedDepth"),
            "is a damaged PNG image",
        ),
    ],
)
def test_messages_after_a_damaged_one_are_read(bad: Message, reason: str, tmp_path: Path) -> None:
    good = {
        "PointCloud2": cloud("/t", ORGANIZED),
        "Image": image("/t", DEPTH_MM, "16UC1"),
        "CompressedImage": compressed_image(
            "/t", PNG_PARAMETERS + png(DEPTH_MM), "16UC1; compressedDepth png"
        ),
    }[bad.type]
    path = write_bag(tmp_path, "mcap", [good, bad, good, camera_info("/camera_info", 8, 6, K, P)])
    before, broken, after = read(path, "/t")
    assert isinstance(broken.cloud, DoorstateError)
    assert reason in str(broken.cloud)
    assert "\n" not in str(broken.cloud)
    assert broken.stamp_s == START_NS / 1e9
    np.testing.assert_array_equal(before.cloud, after.cloud)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part", [0, 0.001, 0.5, 0.999])
def test_truncated_bags_are_errors(kind: str, part: float, tmp_path: Path) -> None:
    clouds = [cloud("/points", np.ones((60, 80, 3)), START_NS + i) for i in range(4)]
    path = write_bag(tmp_path, kind, clouds)
    file = path if path.is_file() else path / f"{path.name}.{kind}"
    content = file.read_bytes()
    file.write_bytes(content[: int(part * len(content))])
    assert read_error(path, "/points").message.startswith("damaged")


def test_messages_before_the_damage_are_read(tmp_path: Path) -> None:
    path = write_bag(tmp_path, "bag", [cloud("/points", ORGANIZED, START_NS + i) for i in range(3)])
    first, second, *rest = path.read_bytes().split(b"op=\x02")  # the records that hold messages
    path.write_bytes(b"op=\x02".join([first, second]) + b"op=\x09" + b"op=\x02".join(rest))
    with open_bag(path) as bag:
        clouds = bag.clouds(bag.choose("/points"))
        assert isinstance(next(clouds).cloud, np.ndarray)
        with pytest.raises(CloudReadError, match="damaged from here on"):
            list(clouds)


def test_other_files_are_not_bags(tmp_path: Path) -> None:
    assert "no such file" in read_error(tmp_path / "gone.bag").message
    (tmp_path / "cloud.pcd").write_bytes(b"")
    assert ".bag .db3 .mcap" in str(read_error(tmp_path / "cloud.pcd").expected)
    for name in ("a.bag", "a.db3", "a.mcap"):
        (tmp_path / name).write_bytes(b"garbage" * 1000)
        assert "damaged" in read_error(tmp_path / name).message
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "metadata.yaml").write_text("[")
    assert "damaged" in read_error(tmp_path / "folder").message


def test_missing_rosbags_is_named_in_the_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    with pytest.raises(MissingExtraError, match="bags"):
        read(tmp_path / "a.bag")
