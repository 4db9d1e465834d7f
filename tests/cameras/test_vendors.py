# SPDX-License-Identifier: Apache-2.0
"""Cameras of the vendors with stand-ins for their software, and the names of the real software where it is there."""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import doorstate.cameras
from doorstate.cameras.device import CameraRequest, DepthCameraDevice, DepthFrame
from doorstate.cameras.registry import CAMERAS, list_cameras, make_camera
from doorstate.errors import CameraError, CameraGoneError, ConfigError, MissingExtraError
from tests.cameras.fake_sdks import (
    HEIGHT,
    REAL_NAMES,
    WIDTH,
    OakDevice,
    OrbbecDevice,
    OrbbecPipeline,
    OrbbecProfile,
    fake_depthai,
    fake_pyorbbecsdk,
)

SOURCE = Path(doorstate.cameras.__file__).parent
MODULES = {"realsense": "pyrealsense2", "oak": "depthai", "orbbec": "pyorbbecsdk", "openni": "openni"}


@pytest.fixture
def oak(monkeypatch: pytest.MonkeyPatch) -> DepthCameraDevice:
    monkeypatch.setitem(sys.modules, "depthai", fake_depthai())
    return make_camera("oak")


@pytest.fixture
def orbbec(monkeypatch: pytest.MonkeyPatch) -> DepthCameraDevice:
    monkeypatch.setitem(sys.modules, "pyorbbecsdk", fake_pyorbbecsdk())
    return make_camera("orbbec")


def read(camera: DepthCameraDevice, count: int) -> list[DepthFrame]:
    frames = [camera.read(0.2) for _ in range(count)]
    assert None not in frames
    return [frame for frame in frames if frame is not None]


def test_oak_frames_have_depth_camera_time_and_gravity(oak: DepthCameraDevice) -> None:
    assert [camera.serial for camera in oak.list_attached()] == ["14442C10", "19443010"]
    assert oak.open(CameraRequest("19443010")) == "OAK-D 19443010"
    frame = read(oak, 8)[-1]
    assert (frame.number, frame.depth_scale_m) == (7, 0.001)
    assert (frame.depth == 1507).all()
    camera = frame.intrinsics
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (16, 10, 20, 21, 7, 5)
    assert frame.up == pytest.approx((0, -1, 0)), "turned from the axes of the accelerometer"
    assert oak.read(0.01) is None
    oak.close()
    oak.close()


def test_oak_without_calibrated_accelerometer_tells_no_gravity(oak: DepthCameraDevice) -> None:
    OakDevice.calibration.imu = None
    oak.open(CameraRequest())
    assert read(oak, 8)[-1].up is None


def test_oak_unplugged(oak: DepthCameraDevice) -> None:
    oak.open(CameraRequest())
    OakDevice.cable.is_in = False
    with pytest.raises(CameraGoneError):
        oak.read(0.1)
    with pytest.raises(CameraGoneError):
        oak.open(CameraRequest())
    OakDevice.cable.is_in = True
    assert oak.open(CameraRequest()) == "OAK-D 14442C10"


def test_oak_plays_no_recordings(oak: DepthCameraDevice) -> None:
    with pytest.raises(ConfigError):
        oak.open(CameraRequest(recording=Path("a.mcap")))


def test_orbbec_frames_have_depth_camera_and_gravity(orbbec: DepthCameraDevice) -> None:
    assert orbbec.open(CameraRequest()) == "Gemini 335 CP12"
    frame = read(orbbec, 8)[-1]
    assert (frame.number, frame.depth_scale_m) == (7, 0.0005)
    assert (frame.depth == 3007).all()
    assert frame.depth.shape == (HEIGHT, WIDTH)
    assert frame.intrinsics.fx == 20
    assert frame.intrinsics.distortion is None
    assert frame.up == pytest.approx((0, -1, 0))
    orbbec.close()
    orbbec.close()


def test_orbbec_lenses_are_those_of_ros(orbbec: DepthCameraDevice) -> None:
    OrbbecPipeline.model = "BROWN_CONRADY_K6"
    orbbec.open(CameraRequest(size=(WIDTH, HEIGHT), fps=30))
    lens = read(orbbec, 1)[0].intrinsics.distortion
    assert lens is not None
    assert lens.model == "rational_polynomial"
    assert lens.coefficients == (0.1, 0.02, 1e-4, 2e-4, 0.001, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("rotation", [np.zeros(9), np.full(9, np.nan), np.diag([1, 1, -1])])
def test_orbbec_without_calibrated_accelerometer_tells_no_gravity(
    orbbec: DepthCameraDevice, rotation: Any
) -> None:
    OrbbecProfile.rotation = rotation
    orbbec.open(CameraRequest())
    assert read(orbbec, 8)[-1].up is None


def test_orbbec_unplugged_and_modes(orbbec: DepthCameraDevice) -> None:
    with pytest.raises(CameraError) as raised:
        orbbec.open(CameraRequest(size=(1, 1)))
    assert raised.value.field == "size"
    with pytest.raises(CameraGoneError):
        orbbec.open(CameraRequest("another"))
    orbbec.open(CameraRequest())
    OrbbecDevice.cable.is_in = False
    with pytest.raises(CameraGoneError):
        orbbec.read(0.1)
    OrbbecDevice.cable.is_in = True
    orbbec.open(CameraRequest())
    assert len(read(orbbec, 3)) == 3


def test_orbbec_recording_ends(orbbec: DepthCameraDevice) -> None:
    orbbec.open(CameraRequest(recording=Path("a.bag")))
    assert len(read(orbbec, 8)) == 8
    with pytest.raises(CameraGoneError):
        orbbec.read(0.05)


@pytest.mark.parametrize("kind", MODULES)
def test_missing_software_names_its_extra(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, MODULES[kind], None)
    monkeypatch.setattr(
        "doorstate.cameras.device.import_module", lambda name: raise_(ModuleNotFoundError(name=name))
    )
    with pytest.raises(MissingExtraError) as raised:
        make_camera(kind)
    assert raised.value.hint == f'pip install "doorstate[{kind}]"'


def test_software_without_its_library_is_another_error(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ImportError("libusb-1.0.so.0: cannot open shared object file")
    monkeypatch.setattr("doorstate.cameras.device.import_module", lambda name: raise_(problem))
    with pytest.raises(CameraError, match="libusb"):
        make_camera("realsense")


def raise_(error: Exception) -> Any:
    raise error


def test_an_unknown_kind() -> None:
    with pytest.raises(ConfigError) as raised:
        make_camera("realsens")
    assert raised.value.field == "camera"


def test_the_list_says_why_others_are_not_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in MODULES.values():
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, "depthai", fake_depthai())
    found, problems = list_cameras()
    assert [camera.kind for camera in found] == ["oak", "oak", "simulated", "simulated"]
    assert set(problems) == {"realsense", "orbbec", "openni"}


@pytest.mark.parametrize("kind", CAMERAS)
def test_importing_a_camera_imports_no_software_of_vendors(kind: str) -> None:
    module = import_module(f"doorstate.cameras.{kind}")
    assert getattr(module, CAMERAS[kind]).kind == kind
    assert not any(name in vars(module) for name in MODULES.values())


def real(package: str) -> Any:
    """Return an installed package of a vendor."""
    sys.modules.pop(package, None)
    try:
        return import_module(package)
    except ImportError:
        pytest.skip(f"{package} cannot be loaded")


@pytest.mark.parametrize("package", REAL_NAMES)
def test_stand_ins_have_only_names_of_the_real_software(package: str) -> None:
    module = real(package)
    for name, stand_in in REAL_NAMES[package].items():
        found = module
        for part in name.split("."):
            found = getattr(found, part)
        own = {attribute for attribute in vars(stand_in) if not attribute.startswith("_")}
        own -= {"cable", "ids", "calibration", "imu", "model", "rotation"}
        assert own <= set(dir(found)), name


@pytest.mark.parametrize(
    ("kind", "roots"), [("realsense", "rs"), ("oak", "dai"), ("orbbec", "ob"), ("openni", "ni")]
)
def test_names_in_the_source_exist_in_the_real_software(kind: str, roots: str) -> None:
    module = real("openni.openni2" if kind == "openni" else MODULES[kind])
    chains = {
        chain
        for node in ast.walk(ast.parse((SOURCE / f"{kind}.py").read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and (chain := chain_of(node, {roots, f"self._{roots}"}))
    }
    assert len(chains) > 5
    for chain in chains:
        found: Any = module
        for part in chain.split("."):
            assert hasattr(found, part), chain
            found = getattr(found, part)


def chain_of(node: ast.Attribute, roots: set[str]) -> str:
    """Return names such as `stream.depth` of an expression `rs.stream.depth`; "" of another root."""
    text = ast.unparse(node)
    root = next((root for root in roots if text.startswith(f"{root}.")), None)
    return "" if root is None or "(" in text else text.removeprefix(f"{root}.")
