# SPDX-License-Identifier: Apache-2.0
"""Structured-light and stereo cameras (docs/sensors.md)."""

from __future__ import annotations

from doorstate.simulation.camera import CAMERAS, DepthCamera
from doorstate.simulation.noise.axial import NguyenAxial, StereoAxial
from doorstate.simulation.noise.matching.mismatches import Mismatches
from doorstate.simulation.noise.matching.model import MatchingModel
from doorstate.simulation.noise.optical import Emitter

_EMITTER_OFF = 0.1  # assumed: share of the scenes in which a stereo camera's emitter is off


def _structured_light(name: str, camera: DepthCamera) -> MatchingModel:
    return MatchingModel(
        name=name,
        camera=camera,
        baseline_m=0.075,
        second_imager=False,
        window_px=9,
        step_px=1 / 8,
        axial=NguyenAxial(),
        emitter=Emitter(reach_m=7.0, sun_reach_m=0.7),
        mismatches=Mismatches(share=0.003),
    )


def _stereo(
    name: str,
    camera: DepthCamera,
    baseline_m: float,
    step_px: float = 1 / 32,
    disparity_px: float = 0.08,
    reach_m: float | None = 5.0,
) -> MatchingModel:
    emitter = reach_m and Emitter(reach_m=reach_m, sun_reach_m=0.8, off_share=_EMITTER_OFF)
    return MatchingModel(
        name=name,
        camera=camera,
        baseline_m=baseline_m,
        window_px=7,
        step_px=step_px,
        axial=StereoAxial(baseline_m=baseline_m, disparity_px=disparity_px),
        emitter=emitter or None,
    )


def _camera(width: int, height: int, hfov_deg: float, nearest_m: float, farthest_m: float) -> DepthCamera:
    return DepthCamera(
        width=width, height=height, hfov_deg=hfov_deg, min_depth_m=nearest_m, max_depth_m=farthest_m
    )


MATCHING_SENSORS = (
    _structured_light("xtion-matching", CAMERAS["xtion-hw"]),
    _structured_light("kinect-matching", _camera(640, 480, 57.0, 0.8, 4.0)),
    # Nearest depths of RealSense cameras: f b / 126.
    _stereo("d415", _camera(848, 480, 65.0, 0.29, 10.0), 0.055),
    _stereo("d435-matching", _camera(848, 480, 90.0, 0.168, 10.0), 0.050),
    _stereo("d455", _camera(848, 480, 87.0, 0.337, 10.0), 0.095),
    # Luxonis: f = 882.5 px at 1280 columns, disparities up to 95 px; no emitter.
    _stereo("oak-d", _camera(640, 400, 71.9, 0.348, 12.0), 0.075, 1 / 8, 0.1, reach_m=None),
    _stereo("oak-d-pro", _camera(640, 400, 80.0, 0.301, 12.0), 0.075, 1 / 8, 0.1),
    _stereo("gemini-2", _camera(640, 400, 91.0, 0.15, 10.0), 0.050),
    _stereo("gemini-335", _camera(848, 480, 90.0, 0.168, 10.0), 0.050),
)
