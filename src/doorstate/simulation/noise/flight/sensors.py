# SPDX-License-Identifier: Apache-2.0
"""Time-of-flight cameras (docs/sensors.md)."""

from __future__ import annotations

import math

from doorstate.simulation.camera import DepthCamera
from doorstate.simulation.noise.axial import FlightAxial
from doorstate.simulation.noise.flight.model import FlightModel
from doorstate.simulation.noise.flight.wiggling import Wiggling
from doorstate.simulation.noise.optical import Emitter

# The published systematic error, 11 mm + 0.1 %, is the largest; 4 mm of wiggling is assumed.
_AZURE_WIGGLING = Wiggling(amplitude_m=0.004, period_m=0.19)
_AZURE_AXIAL = FlightAxial(base_m=0.001, linear=0.0, square_per_m=0.0005)

FLIGHT_SENSORS = (
    FlightModel(
        name="kinect-2",
        camera=DepthCamera(
            width=512,
            height=424,
            hfov_deg=round(2 * math.degrees(math.atan(256 / 365.456)), 4),
            min_depth_m=0.5,
            max_depth_m=4.5,
            cx_px=254.878,
            cy_px=205.395,
        ),
        emitter=Emitter(reach_m=9.0, sun_reach_m=1.5),
        axial=FlightAxial(),
        # 120 MHz: ambiguous after 1.25 m.
        wiggling=Wiggling(amplitude_m=0.006, period_m=0.3125),
    ),
    FlightModel(
        name="azure-kinect",
        camera=DepthCamera(width=640, height=576, hfov_deg=75.0, min_depth_m=0.5, max_depth_m=3.86),
        emitter=Emitter(reach_m=8.0, sun_reach_m=1.0),
        axial=_AZURE_AXIAL,
        wiggling=_AZURE_WIGGLING,
        lit_radius_px=385.0,
    ),
    FlightModel(
        name="azure-kinect-wide",
        camera=DepthCamera(width=512, height=512, hfov_deg=120.0, min_depth_m=0.25, max_depth_m=2.88),
        emitter=Emitter(reach_m=6.0, sun_reach_m=0.8),
        axial=_AZURE_AXIAL,
        wiggling=_AZURE_WIGGLING,
        lit_radius_px=256.0,
    ),
)
