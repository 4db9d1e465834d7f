# SPDX-License-Identifier: Apache-2.0
"""Kinds of cameras by name; the software of a vendor is imported when its camera is made."""

from __future__ import annotations

from importlib import import_module

from doorstate.cameras.device import AttachedCamera, DepthCameraDevice
from doorstate.errors import DoorstateError, unknown_name

CAMERAS = {
    "realsense": "RealSenseCamera",
    "oak": "OakCamera",
    "orbbec": "OrbbecCamera",
    "openni": "OpenNICamera",
    "simulated": "SimulatedCamera",
}
"""Classes by kind; each is in the module of its kind."""


def make_camera(kind: str) -> DepthCameraDevice:
    """Return a camera that is not open yet.

    Raises:
        ConfigError: no such kind.
        MissingExtraError: its software is not installed.
        CameraError: its software cannot be loaded.
    """
    if kind not in CAMERAS:
        raise unknown_name("camera", kind, CAMERAS, field="camera")
    camera: DepthCameraDevice = getattr(import_module(f"doorstate.cameras.{kind}"), CAMERAS[kind])()
    return camera


def list_cameras() -> tuple[list[AttachedCamera], dict[str, DoorstateError]]:
    """Return all attached cameras, and by kind why others could not be looked for."""
    found: list[AttachedCamera] = []
    problems: dict[str, DoorstateError] = {}
    for kind in CAMERAS:
        try:
            found += make_camera(kind).list_attached()
        except DoorstateError as error:
            problems[kind] = error
    return found, problems
