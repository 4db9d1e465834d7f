# SPDX-License-Identifier: Apache-2.0
"""Sensor models by name (docs/sensors.md)."""

from __future__ import annotations

import math

from doorstate.errors import ConfigError, unknown_name
from doorstate.simulation.camera import CAMERAS, DepthCamera
from doorstate.simulation.noise.axial import ConstantAxial, NguyenAxial, StereoAxial
from doorstate.simulation.noise.dropout import Grazing, Speckle
from doorstate.simulation.noise.edges import Edges
from doorstate.simulation.noise.flight.sensors import FLIGHT_SENSORS
from doorstate.simulation.noise.lateral import Lateral
from doorstate.simulation.noise.matching.sensors import MATCHING_SENSORS
from doorstate.simulation.noise.materials import Materials
from doorstate.simulation.noise.model import Model, SensorModel
from doorstate.simulation.noise.quantisation import DepthSteps, DisparitySteps
from doorstate.simulation.noise.shadow import SecondView


def gaussian(deviation_m: float) -> SensorModel:
    """Return a model of normal noise with one standard deviation and no other stage."""
    return SensorModel(name=f"gaussian:{deviation_m:g}", axial=ConstantAxial(deviation_m=deviation_m))


def _structured_light(name: str, camera: DepthCamera) -> SensorModel:
    # Chips of PrimeSense: baseline 75 mm, projector to the right as the camera looks, disparity in 1/8 px.
    return SensorModel(
        name=name,
        camera=camera,
        materials=Materials(),
        second_view=SecondView(baseline_m=0.075),
        lateral=Lateral(),
        axial=NguyenAxial(),
        disparity_steps=DisparitySteps(baseline_m=0.075, step_px=1 / 8),
        grazing=Grazing(),
        edges=Edges(),
        speckle=Speckle(share=0.002, side_px=3),
    )


_D435 = SensorModel(
    name="d435",
    # f = 424 px; nearest depth f b / 126; 10 m is assumed.
    camera=DepthCamera(width=848, height=480, hfov_deg=90.0, min_depth_m=0.168, max_depth_m=10.0),
    materials=Materials(),
    second_view=SecondView(baseline_m=0.050, is_imager=True),
    axial=StereoAxial(baseline_m=0.050, disparity_px=0.08),
    disparity_steps=DisparitySteps(baseline_m=0.050, step_px=1 / 32),
    edges=Edges(),
    speckle=Speckle(share=0.01, side_px=9),
)
# 640 x 480, f = 384.681, centre (319.226, 242.138), put upright by a clockwise quarter turn (dataset/deepdoors2.py): a
# column becomes a row, and row v becomes column 479 - v. The second imager is then below.
_DEEPDOORS2 = _D435.model_copy(
    update={
        "name": "deepdoors2",
        "camera": DepthCamera(
            width=480,
            height=640,
            hfov_deg=2 * math.degrees(math.atan(240 / 384.681)),
            min_depth_m=0.168,
            max_depth_m=10.0,
            cx_px=479 - 242.138,
            cy_px=319.226,
        ),
        "second_view": SecondView(baseline_m=0.050, is_imager=True, towards="down"),
        "depth_steps": DepthSteps(step_m=1 / 16, bits=8),
    }
)
_DEFAULT_GAUSSIAN_M = 0.01
STAGE_SENSORS = {
    model.name: model
    for model in (
        SensorModel(name="none"),
        gaussian(_DEFAULT_GAUSSIAN_M).model_copy(update={"name": "gaussian"}),
        _structured_light("xtion", CAMERAS["xtion-hw"]),
        # Kinect v1: 57 degrees, 0.8-4.0 m.
        _structured_light("kinect", DepthCamera(hfov_deg=57.0, min_depth_m=0.8, max_depth_m=4.0)),
        _D435,
        _DEEPDOORS2,
    )
}
"""Sensors whose pixels have noise of their own; published data sets hold these."""
SENSORS: dict[str, Model] = {
    **STAGE_SENSORS,
    **{model.name: model for model in (*MATCHING_SENSORS, *FLIGHT_SENSORS)},
}


def find_sensor(name: str) -> Model:
    """Return a model by name; `gaussian:0.02` has a standard deviation of 0.02 m.

    Raises:
        ConfigError: no such sensor.
    """
    kind, _, deviation = name.partition(":")
    if kind == "gaussian" and deviation:
        try:
            value = float(deviation)
        except ValueError:
            value = math.nan
        if not 0 <= value < math.inf:
            raise ConfigError(
                f"no sensor {name!r}",
                field="sensor",
                expected="a standard deviation in metres after the colon",
            )
        return gaussian(value)
    if name not in SENSORS:
        raise unknown_name("sensor", name, [*SENSORS, "gaussian:METRES"], field="sensor")
    return SENSORS[name]
