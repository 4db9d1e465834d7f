# SPDX-License-Identifier: Apache-2.0
"""All targets by name; those of formats and message types are defined here. atheris drives the same tests.

Every input must either be read or be refused with one of the package's own errors in one line. No other exception, no
warning, at most a second of processor time, and no prepared cloud from fewer measured points than a network needs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
from fastapi import HTTPException
from hypothesis import strategies as st

from doorstate.clouds.preparation import MIN_POINTS, CloudSpec, prepare_cloud
from doorstate.errors import DoorstateError
from doorstate.io.bags import open_bag
from doorstate.io.body_frame import points_from_depth
from doorstate.io.camera import Pinhole
from doorstate.io.camera_files import read_intrinsics
from doorstate.io.formats import BAG_SUFFIXES, CLOUD_SUFFIXES
from doorstate.io.messages import cloud_from_message
from doorstate.io.options import ReadOptions
from doorstate.io.readers import parse_cloud, read_cloud
from doorstate.io.rvl import parse_rvl
from doorstate.serving.body import read_body
from doorstate.serving.errors import STATUS_DESCRIPTIONS
from doorstate.types import Points
from tests.fuzz import examples, predictions, settings_files
from tests.fuzz.harness import Target, check_line, fuzz_target, outcome_of
from tests.fuzz.strategies import (
    OPTIONS,
    YAML_TOKENS,
    cloud_messages,
    compressed_messages,
    damaged,
    image_messages,
    png_files,
)

_SPEC = CloudSpec(num_points=MIN_POINTS)
_SCRATCH = TemporaryDirectory()
_FOLDER = Path(_SCRATCH.name)
_MAX_BODY = 1 << 16
_STEMS = ("cloud", b"\xff\xfe".decode(errors="surrogateescape"), "é", "a b\tc", "-", "%s{}")


def check(read: Callable[[], Points]) -> str:
    """Read and prepare one input, and return `prepared` or the name of the error that refused it.

    Raises:
        AssertionError: neither, or too slowly.
    """

    def prepare() -> str:
        points = read()
        assert points.dtype == np.float32
        assert points.ndim in (2, 3)
        assert points.shape[-1] == 3
        prepared = prepare_cloud(points, _SPEC).points
        assert np.isfinite(prepared).all()
        assert len(np.unique(prepared, axis=0)) == MIN_POINTS
        return "prepared"

    return outcome_of(prepare)


def _read_file(data: bytes, options: ReadOptions, suffix: str) -> None:
    check(lambda: parse_cloud(data, suffix, options))


def _read_named(data: bytes, stem: str) -> None:
    path = _FOLDER / f"{stem}.csv"
    path.write_bytes(data)
    check(lambda: read_cloud(path))


def _read_camera(data: bytes, suffix: str) -> None:
    path = _FOLDER / f"camera{suffix}"
    path.write_bytes(data)

    def read() -> Points:
        camera = read_intrinsics(path)
        pinhole = Pinhole(camera.fx, camera.fy, camera.cx, camera.cy)
        return points_from_depth(examples.SCENE[..., 0], ReadOptions(intrinsics=pinhole)).points

    check(read)


def _read_message(message: SimpleNamespace, options: ReadOptions, message_type: str) -> None:
    check(lambda: cloud_from_message(message, f"sensor_msgs/msg/{message_type}", options).points)


def _read_rvl(data: bytes) -> None:
    outcome_of(lambda: str(parse_rvl(data).shape))


def _read_body(data: bytes, headers: dict[str, str]) -> None:
    """Find the file in the body of a request; a refusal is a documented status, in one line."""

    def read() -> str:
        try:
            upload = read_body(data, headers, _MAX_BODY)
            assert len(upload.content) <= _MAX_BODY
            return upload.suffix
        except HTTPException as refusal:
            check_line(refusal.detail)
            return str(refusal.status_code)

    assert outcome_of(read) in {*CLOUD_SUFFIXES, *map(str, STATUS_DESCRIPTIONS), "CloudReadError"}


def _read_bag(path: Path, options: ReadOptions, topic_number: int) -> None:
    """Read the clouds of one topic; a damaged message is an error of its own, and the next one is read."""
    try:
        with open_bag(path) as bag:
            topic = bag.choose(bag.topics[topic_number % len(bag.topics)].name if bag.topics else None)
            for stamped in bag.clouds(topic, options):
                assert math.isfinite(stamped.stamp_s)
                assert isinstance(stamped.frame_id, str)
                check(lambda cloud=stamped.cloud: _cloud_or_raise(cloud))
    except DoorstateError as error:
        check_line(str(error))


def _cloud_or_raise(cloud: Points | DoorstateError) -> Points:
    if isinstance(cloud, DoorstateError):
        raise cloud
    return cloud


def _read_bag_file(data: bytes, options: ReadOptions, topic_number: int, suffix: str) -> None:
    path = _FOLDER / f"damaged{suffix}"
    path.write_bytes(data)
    _read_bag(path, options, topic_number)


def _read_bag_folder(data: bytes, options: ReadOptions, topic_number: int) -> None:
    path = _FOLDER / "bag"
    (path / "metadata.yaml").write_bytes(data)
    _read_bag(path, options, topic_number)


def _metadata() -> st.SearchStrategy[bytes]:
    (_FOLDER / "bag").mkdir(exist_ok=True)
    return damaged(examples.write_bag_folder(_FOLDER / "bag"), YAML_TOKENS)


def _targets() -> dict[str, Target]:
    targets: dict[str, Target] = {}
    for suffix in CLOUD_SUFFIXES:
        data = png_files() if suffix == ".png" else damaged(examples.files(suffix))
        targets[suffix[1:]] = fuzz_target(partial(_read_file, suffix=suffix), data=data, options=OPTIONS)
    targets["name"] = fuzz_target(
        _read_named, data=damaged(examples.files(".csv")), stem=st.sampled_from(_STEMS)
    )
    for suffix in examples.CAMERA_SUFFIXES:
        data = damaged(examples.camera_files(suffix), YAML_TOKENS)
        targets[f"camera-{suffix[1:]}"] = fuzz_target(partial(_read_camera, suffix=suffix), data=data)
    messages = {
        "PointCloud2": cloud_messages(),
        "Image": image_messages(),
        "CompressedImage": compressed_messages(),
    }
    for name, message in messages.items():
        targets[name] = fuzz_target(
            partial(_read_message, message_type=name), message=message, options=OPTIONS
        )
    targets["rvl"] = fuzz_target(
        _read_rvl, data=damaged([examples.rvl_of(cloud) for cloud in examples.CLOUDS])
    )
    targets["body"] = fuzz_target(
        _read_body, data=damaged(examples.bodies()), headers=st.sampled_from(examples.BODY_HEADERS)
    )
    topic_number = st.integers(0, 7)
    for suffix in BAG_SUFFIXES:
        data = st.deferred(lambda suffix=suffix: damaged(examples.bags(suffix)))
        read = partial(_read_bag_file, suffix=suffix)
        targets[suffix[1:]] = fuzz_target(read, data=data, options=OPTIONS, topic_number=topic_number)
    targets["metadata"] = fuzz_target(
        _read_bag_folder, data=st.deferred(_metadata), options=OPTIONS, topic_number=topic_number
    )
    return targets | predictions.targets() | settings_files.targets()


TARGETS = _targets()
