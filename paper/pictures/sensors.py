# SPDX-License-Identifier: Apache-2.0
"""Depth of a half-open door and its error by sensor, and sections of a closed door whose relief noise hides."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.noise.conditions import INDOORS, Conditions
from doorstate.simulation.noise.model import sense
from doorstate.simulation.noise.sensors import SENSORS
from doorstate.simulation.render import render_behind_glass
from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes
from doorstate.types import DepthImage

HALF_OPEN = scene_boxes(Scene(door=Door(hinge="right"), has_ceiling=False), Opening(angle_deg=50))
CLOSED = scene_boxes(Scene(door=Door(), has_ceiling=False), Opening())
BESIDE = CameraPose.from_degrees((0.5, 2.2, 1.1), -103.0, 0.0)
DISTANCES_M = (1.2, 2.2, 3.3)
SENSOR_COLORS = {
    "d435-matching": "#e08214",
    "xtion-matching": "#2166ac",
    "azure-kinect": "#1b7837",
    "none": "black",
}
NO_DEPTH = "#f4a6c0"
OFF = Conditions(emitter_on=False)
SUN = Conditions(sun_share=0.05)
IMAGES = {
    "none": ("none", INDOORS),
    "xtion": ("xtion", INDOORS),
    "xtion-matching": ("xtion-matching", INDOORS),
    "xtion-matching, sun": ("xtion-matching", SUN),
    "d435": ("d435", INDOORS),
    "d435-matching": ("d435-matching", INDOORS),
    "d435-matching, emitter off": ("d435-matching", OFF),
    "azure-kinect": ("azure-kinect", INDOORS),
}
ERRORS = ("xtion", "xtion-matching", "d435-matching", "azure-kinect")


def measured(sensor: str, opened: bool, pose: CameraPose, conditions: Conditions = INDOORS) -> DepthImage:
    """Return the depth of the door measured by a sensor."""
    model, boxes = SENSORS[sensor], HALF_OPEN if opened else CLOSED
    rendered = render_behind_glass(boxes, pose, model.camera.intrinsics())
    return sense(model, rendered, boxes, pose, model.camera, 1, conditions).depth_m


def error_mm(sensor: str) -> DepthImage:
    """Return the error of the half-open door's depth in a square of pixels left of the door."""
    camera = SENSORS[sensor].camera.intrinsics()
    exact = render_behind_glass(HALF_OPEN, BESIDE, camera).depth_m
    middle, side = camera.height // 2, 60
    part = np.s_[middle - side : middle + side, camera.width // 4 - side : camera.width // 4 + side]
    return 1000 * (measured(sensor, True, BESIDE)[part] - exact[part])


def section(sensor: str, distance_m: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return a row of pixels 1.2 m above the floor: metres along the wall, and metres out of it."""
    depth_m = measured(sensor, False, CameraPose.from_degrees((0.0, distance_m, 1.2), -90.0, 0.0))
    pinhole = SENSORS[sensor].camera.intrinsics()
    row = round(pinhole.cy)
    points = depth_to_points(depth_m[row : row + 1], replace(pinhole, height=1, cy=pinhole.cy - row))[0]
    return -points[:, 1], distance_m - points[:, 0]


def draw_section(axes: Axes, distance_m: float) -> None:
    """Draw the closed door from above."""
    for sensor, color in SENSOR_COLORS.items():
        along, out = section(sensor, distance_m)
        line = {"linewidth": 1.2} if sensor == "none" else {"marker": ".", "markersize": 3, "linestyle": ""}
        axes.plot(along, 1000 * out, color=color, label=sensor, **line)
    axes.set(xlim=(-0.75, 0.75), ylim=(-110, 110), xlabel="along the wall, m")
    axes.set_title(f"closed door from {distance_m:g} m", fontsize=10)


def draw() -> bytes:
    """Return the picture as PNG."""
    figure = Figure(figsize=(11, 11), layout="constrained")
    grid = figure.add_gridspec(3, 1, height_ratios=(1.75, 1, 1))
    upper, middle, lower = (figure.add_subfigure(grid[row]) for row in range(3))
    colors = colormaps["viridis_r"].with_extremes(bad=NO_DEPTH)
    images = upper.subplots(2, 4).ravel()
    for axes, (title, (sensor, conditions)) in zip(images, IMAGES.items(), strict=True):
        depth_m = measured(sensor, True, BESIDE, conditions)
        image = axes.imshow(depth_m, cmap=colors, vmin=1.0, vmax=4.0, interpolation="nearest")
        axes.set_title(title, fontsize=10)
        axes.set(xticks=[], yticks=[])
    upper.colorbar(image, ax=images.tolist(), label="depth, m (pink: none)", shrink=0.8)
    errors = middle.subplots(1, 4)
    colors = colormaps["RdBu"].with_extremes(bad=NO_DEPTH)
    for axes, sensor in zip(errors, ERRORS, strict=True):
        image = axes.imshow(error_mm(sensor), cmap=colors, vmin=-40, vmax=40, interpolation="nearest")
        axes.set_title(f"{sensor}, error", fontsize=10)
        axes.set(xticks=[], yticks=[])
    middle.colorbar(image, ax=errors.tolist(), label="mm too far", shrink=0.8)
    sections = lower.subplots(1, 3, sharey=True)
    for axes, distance_m in zip(sections, DISTANCES_M, strict=True):
        draw_section(axes, distance_m)
    sections[0].set_ylabel("out of the wall, mm")
    handles, labels = sections[-1].get_legend_handles_labels()
    sections[-1].legend(handles, labels, loc="lower right", fontsize=8, markerscale=3)
    png = BytesIO()
    figure.savefig(png, dpi=100)
    return png.getvalue()
