# SPDX-License-Identifier: Apache-2.0
"""Quick fuzz tests: a hundred inputs for each target, the same in every run."""

from __future__ import annotations

import gzip

import pytest

pytest.importorskip("rosbags")
pytest.importorskip("fastapi")

import numpy as np

from doorstate.io.camera import Pinhole
from doorstate.io.formats import CLOUD_SUFFIXES
from doorstate.io.options import ReadOptions
from doorstate.io.readers import parse_cloud
from doorstate.types import Points
from tests.fuzz import examples, harness, predictions, settings_files, targets
from tests.hand_made_clouds import image_of_a_rough_wall


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
    started = harness.time.process_time()
    while harness.time.process_time() - started < 2 * harness.LIMIT_S:
        pass
    return examples.SCENE


@pytest.mark.parametrize(
    "read", [_slow, lambda: examples.SCENE.astype(np.float64), lambda: examples.SCENE[..., :2]]
)
def test_failures_are_noticed(read: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(harness, "LIMIT_S", 0.05)
    with pytest.raises(AssertionError):
        targets.check(read)  # type: ignore[arg-type]


_REPEATED_COLUMNS = (
    b"method,fnld,role,0,test,method,fold,role,_po,pen,reaso.5,\n_open,p_open,reason,opening_angle_dgo,epef_or_not\n"
    b"pointnet,5,test,a,open,closed,0.8,0.1,0.1,,12.5,\n"
)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("experiment.toml", b"seed = " + b"[" * 5000),
        ("experiment.toml", b"seed = " + b"1" * 5000),
        ("comparison.json", b'{"name": ' + b"[" * 100_000),
        ("comparison.json", b'{"name": "a", "dataset": "data", "networks": 5}'),
        ("rows.csv", b"sample_id,scene\na," + b"[" * 100_000),
        ("rows.csv", b"sample_id,camera,camera.width\na,b,640"),
        ("data/manifest.csv", b"sample_id,state\na,open\na,open\nb,closed\n"),
        ("predictions.csv.gz", gzip.compress(b"fold\n" + b"9" * 30, mtime=0)),
        ("predictions.csv.gz", gzip.compress(b"fold\n1,2,3\n", mtime=0)),
        ("predictions.csv.gz", gzip.compress(_REPEATED_COLUMNS, mtime=0)),
        (
            "metrics.json",
            b'{"runs": [{"method": "pointnet", "fold": -9, "metrics": {}, "environment": {}, "log": {}}]}',
        ),
    ],
)
def test_settings_that_once_failed_are_refused(name: str, data: bytes) -> None:
    assert settings_files.read_settings(data, name).endswith("Error")


def test_requests_that_once_failed_are_refused() -> None:
    for query, headers in ((b"\x00=1", []), (b"roll=\xff", []), (None, [(b"content-length", b"x")])):
        predictions.request_prediction((".npy", b""), query, headers)


def test_half_precision_is_accepted() -> None:
    cloud = image_of_a_rough_wall(60, 80).astype(np.float16)
    assert predictions.predict_with_rule(cloud, None, "plane_state") == predictions.predict_with_rule(
        cloud.astype(np.float32), None, "plane_state"
    )
