# SPDX-License-Identifier: Apache-2.0
"""Bags of a camera, read again as any other bag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from doorstate.cameras.device import DepthFrame
from doorstate.cameras.recording import IMAGE_TOPIC, INFO_TOPIC, MOTION_TOPIC, RAW_IMAGE_TOPIC, record_bag
from doorstate.errors import ConfigError, OutputError
from doorstate.io.bags import StampedCloud, open_bag
from doorstate.io.body_frame import points_from_depth
from doorstate.io.distortion import Distortion
from doorstate.io.options import ReadOptions
from tests.cameras.scripted import frame

pytest.importorskip("rosbags")
START_NS = 1_700_000_000_123_456_000
SUFFIXES = pytest.mark.parametrize("suffix", [".bag", ".mcap"])


def record(path: Path, *frames: DepthFrame) -> list[StampedCloud]:
    with record_bag(path, "optical") as recorder:
        for number, one in enumerate(frames):
            recorder.write(one, START_NS + number * 10**8)
    assert recorder.frames == len(frames)
    with open_bag(path) as bag:
        return list(bag.clouds(bag.choose()))


def expected_points(one: DepthFrame) -> Any:
    depth_m = (one.depth * one.depth_scale_m).astype(np.float32)
    return points_from_depth(depth_m, ReadOptions(intrinsics=one.intrinsics)).points


@SUFFIXES
def test_millimetres_are_read_again(tmp_path: Path, suffix: str) -> None:
    frames = [frame(k, depth=1000 + 500 * k) for k in range(3)]
    frames[1].depth[2, 3] = 0
    clouds = record(tmp_path / f"run{suffix}", *frames)
    assert [cloud.stamp_s for cloud in clouds] == pytest.approx(
        [1_700_000_000.123456 + k / 10 for k in range(3)]
    )
    for one, cloud in zip(frames, clouds, strict=True):
        assert cloud.frame_id == "optical"
        assert np.allclose(cloud.cloud, expected_points(one), atol=1e-6, equal_nan=True)
    assert [path.name for path in tmp_path.iterdir()] == [f"run{suffix}"], "nothing else is left"
    with open_bag(tmp_path / f"run{suffix}") as bag:
        counts = {topic.name: topic.messages for topic in bag.topics}
    assert counts == {IMAGE_TOPIC: 3, INFO_TOPIC: 3, MOTION_TOPIC: 3}


@SUFFIXES
def test_other_units_metres_and_lenses_are_read_again(tmp_path: Path, suffix: str) -> None:
    plain = frame(0, depth=20_000, up=None)
    fine = replace(plain, depth_scale_m=1e-4)
    (cloud,) = record(tmp_path / f"fine{suffix}", fine)
    assert np.allclose(cloud.cloud, expected_points(fine), atol=1e-6)
    metres = replace(plain, depth=np.full((6, 8), 2.5, np.float32), depth_scale_m=1.0)
    (cloud,) = record(tmp_path / f"metres{suffix}", metres)
    assert np.allclose(cloud.cloud, expected_points(metres), atol=1e-6)
    lens = Distortion("plumb_bob", (0.1, 0.01, 1e-3, 1e-3, 0.0))
    bent = replace(plain, intrinsics=replace(plain.intrinsics, distortion=lens), depth_scale_m=1e-3)
    (cloud,) = record(tmp_path / f"bent{suffix}", bent)
    assert np.allclose(cloud.cloud, expected_points(bent), atol=1e-5, equal_nan=True)
    with open_bag(tmp_path / f"bent{suffix}") as bag:
        assert {topic.name for topic in bag.topics} == {RAW_IMAGE_TOPIC, INFO_TOPIC}


def test_what_is_interrupted_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.bag"
    with pytest.raises(KeyboardInterrupt):
        interrupt(path, KeyboardInterrupt())
    with open_bag(path) as bag:
        assert bag.choose().messages == 1


def test_a_file_that_cannot_be_written_is_left_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "run.bag"
    path.write_bytes(b"before")
    with pytest.raises(OutputError):
        interrupt(path, OutputError("disk full"))
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def interrupt(path: Path, error: BaseException) -> None:
    with record_bag(path, "optical") as recorder:
        recorder.write(frame(1), START_NS)
        raise error


def test_a_full_disk_is_an_error_of_writing(tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        record_on_a_full_disk(tmp_path / "run.bag")
    assert list(tmp_path.iterdir()) == []


def record_on_a_full_disk(path: Path) -> None:
    with record_bag(path, "optical") as recorder:
        recorder._writer = Full()
        recorder.write(frame(1), START_NS)


class Full:
    """Writer on a full disk."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        def fail(*_: Any, **__: Any) -> None:
            raise OSError(28, "No space left on device")

        return fail


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    for name in ("run", "run.db3", "run.csv"):
        with pytest.raises(ConfigError) as raised, record_bag(tmp_path / name, "optical"):
            pass
        assert raised.value.field == "record"
