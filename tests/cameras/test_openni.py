# SPDX-License-Identifier: Apache-2.0
"""Cameras of OpenNI: the dummy driver of its own sources, where library and driver are there.

Debian's libopenni2-0 has both; OPENNI2_REDIST names a folder with libOpenNI2.so and OpenNI2/Drivers. The dummy driver
crashes when it is unloaded after it was opened twice, so it has a process of its own, which ends without unloading.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys

import pytest

HFOV_DEG, VFOV_DEG = 58, 45
SCRIPT = """
import json, math, os, sys
from openni import openni2
from doorstate.cameras.device import CameraRequest
from doorstate.cameras.registry import make_camera
from doorstate.errors import CameraError

hfov, vfov = map(math.radians, map(float, sys.argv[1:]))
camera, mirrored = make_camera("openni"), []
try:
    openni2.Device(b"Dummy").close()
except Exception:
    os._exit(3)
# What the dummy does not have.
openni2.VideoStream.get_horizontal_fov = lambda stream: hfov
openni2.VideoStream.get_vertical_fov = lambda stream: vfov
openni2.VideoStream.set_mirroring_enabled = lambda stream, enabled: mirrored.append(enabled)
errors = []
for request in (CameraRequest("Dummy", size=(7, 7)), CameraRequest("1d27/0601@1/9")):
    try:
        camera.open(request)
    except CameraError as error:
        errors.append([type(error).__name__, error.field])
camera.open(CameraRequest("Dummy"))
frames = [camera.read(1.0) for _ in range(5)]
camera.close()
def describe(frame):
    seen = frame.intrinsics
    numbers = [seen.width, seen.height, seen.fx, seen.fy, seen.cx, seen.cy]
    return [list(frame.depth.shape), str(frame.depth.dtype), frame.depth_scale_m, bool(frame.depth.any()), numbers]
numbers = [frame.number for frame in frames]
print(json.dumps([errors, mirrored, numbers, describe(frames[0])]), flush=True)
os._exit(0)
"""


def test_frames_of_the_dummy() -> None:
    pytest.importorskip("openni")
    command = [sys.executable, "-c", SCRIPT, str(HFOV_DEG), str(VFOV_DEG)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    if done.returncode == 3 or "libOpenNI2 cannot be loaded" in done.stderr:
        pytest.skip("no dummy driver")
    assert done.returncode == 0, done.stderr
    errors, mirrored, numbers, first = json.loads(done.stdout)
    assert errors == [["CameraError", "size"], ["CameraGoneError", None]]
    assert mirrored == [False], "a mirrored door has its hinge on the other side"
    assert len(set(numbers)) == 5
    shape, dtype, scale_m, is_measured, camera = first
    assert (dtype, scale_m, is_measured) == ("uint16", 0.001, True)
    assert camera[:2] == shape[::-1]
    assert camera[2] == pytest.approx(shape[1] / 2 / math.tan(math.radians(HFOV_DEG) / 2))
    assert camera[3] == pytest.approx(shape[0] / 2 / math.tan(math.radians(VFOV_DEG) / 2))
    assert camera[4:] == [shape[1] / 2, shape[0] / 2]
