# SPDX-License-Identifier: Apache-2.0
"""Quick fuzz tests: a hundred inputs for each target, the same in every run."""

from __future__ import annotations

import pytest

pytest.importorskip("rosbags")

import numpy as np

from doorstate.io.camera import Pinhole
from doorstate.io.options import ReadOptions
from doorstate.io.readers import CLOUD_SUFFIXES, parse_cloud
from doorstate.types import Points
from tests.fuzz import examples, targets


@pytest.mark.parametrize("name", targets.TARGETS)
def test_inputs_are_read_or_refused(name: str) -> None:
    targets.TARGETS[name]()


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_examples_are_read(suffix: str) -> None:
    options = ReadOptions(intrinsics=Pinhole(14, 14, 7.5, 5.5))
    outcomes = {
        targets.check(lambda data=data: parse_cloud(data, suffix, options)) for data in examples.files(suffix)
    }
    assert "prepared" in outcomes
    assert outcomes - {"prepared"} <= {"TooFewPointsError", "CameraError", "CloudReadError"}


def _slow() -> Points:
    started = targets.time.process_time()
    while targets.time.process_time() - started < 2 * targets.LIMIT_S:
        pass
    return examples.SCENE


@pytest.mark.parametrize(
    "read", [_slow, lambda: examples.SCENE.astype(np.float64), lambda: examples.SCENE[..., :2]]
)
def test_failures_are_noticed(read: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(targets, "LIMIT_S", 0.05)
    with pytest.raises(AssertionError):
        targets.check(read)  # type: ignore[arg-type]
