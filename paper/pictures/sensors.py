# SPDX-License-Identifier: Apache-2.0
"""docs/images/sensors.png: a half-open door as each sensor measures it, and how noise hides the relief of a closed one.

python tools/sensor_figure.py docs/images/sensors.png
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from doorstate.io.depth import depth_to_points
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.noise.models import SENSORS, sense
from doorstate.simulation.render import render_behind_glass
from doorstate.simulation.scene import Door, Opening, Scene, scene_boxes
from doorstate.types import DepthImage

HALF_OPEN = scene_boxes(Scene(door=Door(hinge="right"), has_ceiling=False), Opening(angle_deg=50))
CLOSED = scene_boxes(Scene(door=Door(), has_ceiling=False), Opening())
BESIDE = CameraPose.from_degrees((0.5, 2.2, 1.1), -103.0, 0.0)
DISTANCES_M = (1.2, 2.2, 3.3)
DRAWN = {"d435": "#e08214", "xtion": "#2166ac", "none": "black"}
LOST = "#f4a6c0"


def measured(sensor: str, opened: bool, pose: CameraPose) -> DepthImage:
    """Depth of the door by this sensor."""
    model, boxes = SENSORS[sensor], HALF_OPEN if opened else CLOSED
    seen = render_behind_glass(boxes, pose, model.camera.intrinsics())
    return sense(model, seen, boxes, pose, model.camera, 1).depth_m


def section(sensor: str, distance_m: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Along the wall, and towards the robot, in metres: a row of pixels 1.2 m above the floor."""
    depth_m = measured(sensor, False, CameraPose.from_degrees((0.0, distance_m, 1.2), -90.0, 0.0))
    pinhole = SENSORS[sensor].camera.intrinsics()
    row = round(pinhole.cy)
    points = depth_to_points(depth_m[row : row + 1], replace(pinhole, height=1, cy=pinhole.cy - row))[0]
    return -points[:, 1], distance_m - points[:, 0]


def draw_section(axes: Axes, distance_m: float) -> None:
    """The closed door from above."""
    for sensor, color in DRAWN.items():
        along, out = section(sensor, distance_m)
        line = {"linewidth": 1.2} if sensor == "none" else {"marker": ".", "markersize": 3, "linestyle": ""}
        axes.plot(along, 1000 * out, color=color, label=sensor, **line)
    axes.set(xlim=(-0.75, 0.75), ylim=(-110, 110), xlabel="along the wall, m")
    axes.set_title(f"closed door from {distance_m:g} m", fontsize=10)


def main(target: str) -> None:
    """Draw both."""
    figure = Figure(figsize=(11, 8.4), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.75, 1))
    colors = colormaps["viridis_r"].with_extremes(bad=LOST)
    images = upper.subplots(2, 3).ravel()
    for axes, sensor in zip(images, SENSORS, strict=True):
        shown = axes.imshow(
            measured(sensor, True, BESIDE), cmap=colors, vmin=1.0, vmax=4.0, interpolation="nearest"
        )
        axes.set_title(sensor, fontsize=10)
        axes.set(xticks=[], yticks=[])
    upper.colorbar(shown, ax=images.tolist(), label="depth, m (pink: none)", shrink=0.8)
    sections = lower.subplots(1, 3, sharey=True)
    for axes, distance_m in zip(sections, DISTANCES_M, strict=True):
        draw_section(axes, distance_m)
    sections[0].set_ylabel("out of the wall, mm")
    handles, labels = sections[-1].get_legend_handles_labels()
    sections[-1].legend(handles, labels, loc="lower right", fontsize=8, markerscale=3)
    figure.savefig(target, dpi=100)


if __name__ == "__main__":
    main(*sys.argv[1:])
