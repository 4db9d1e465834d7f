# SPDX-License-Identifier: Apache-2.0
"""Plan views in the door frame: poses of the robot (the paper's Figure 1) and of misclassified samples."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from doorstate.dataset.strata import REGIONS
from doorstate.evaluation.metrics import Floats
from doorstate.evaluation.results import Results
from doorstate.evaluation.undecidable import is_undecidable
from doorstate.evaluation.views import REGION_COLORS, outside_legend
from doorstate.pages.colors import STATE_COLORS, STATE_WORDS
from doorstate.simulation.manifest import unflatten
from doorstate.simulation.scene import Door, Opening
from doorstate.simulation.scene.door_boxes import leaf_boxes
from doorstate.types import STATES

_RINGS_M = (1.5, 2.0, 2.5, 3.0, 3.5)
_INK, _FAINT = "#333333", "#BBBBBB"
_POSE_COLUMNS = ("x_m", "y_m", "heading_deg", "region")
_PLATE = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
_MARKERS = {"closed": "s", "semi_open": "^", "open": "o"}


def poses_figure(manifest: pd.DataFrame) -> Figure | None:
    """Draw Figure 1: robot poses by region, distance rings, and the door; None for data without poses."""
    with_pose = _with_pose(manifest)
    if with_pose.empty:
        return None
    poses = with_pose.drop_duplicates(["x_m", "y_m", "heading_deg"])
    position = _positions(poses)
    heading_rad = np.radians(poses["heading_deg"].to_numpy(dtype=np.float64))
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axis = figure.subplots()
    _draw_ground(axis, _door_of(manifest))
    ahead = position + 0.07 * np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    for name, color in REGION_COLORS.items():
        inside = (poses["region"] == name).to_numpy()
        headings = np.stack([position[inside], ahead[inside]], axis=1)  # (n, 2, 2)
        axis.add_collection(LineCollection(list(headings), colors=_INK, linewidths=0.4, alpha=0.7, zorder=3))
        axis.scatter(
            position[inside, 0],
            position[inside, 1],
            s=11,
            color=color,
            edgecolors=_INK,
            linewidths=0.25,
            zorder=4,
        )
        _label_region(axis, name, int(inside.sum()))
    axis.spines[["top", "right"]].set_visible(False)
    axis.set(xlabel="along the wall (m)", ylabel="away from the wall (m)")
    axis.set_title(f"{len(poses)} robot poses; the tick points where the camera looks", fontsize=10)
    return figure


def errors_figure(results: Results) -> Figure | None:
    """Draw the poses of each method's misclassified samples; None without poses or without errors."""
    with_pose, errors = _with_pose(results.manifest), results.errors
    if with_pose.empty or errors.empty:
        return None
    methods = results.methods
    columns = min(3, len(methods))
    lines = math.ceil(len(methods) / columns)
    figure = Figure(figsize=(4.2 * columns, 2.4 * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    everywhere = np.unique(_positions(with_pose), axis=0)
    undecidable = is_undecidable(errors)
    for axis, method in zip(axes, methods, strict=False):
        axis.scatter(*everywhere.T, s=2, color=_FAINT, linewidths=0, rasterized=True)
        _draw_ground(axis, _door_of(results.manifest), lettering=False)
        of_method = errors["method"] == method
        for state in STATES:
            for hollow in (False, True):
                chosen = (
                    of_method & (errors["state"] == state) & (undecidable == hollow) & errors["x_m"].notna()
                )
                axis.scatter(
                    *_positions(errors[chosen]).T,
                    s=26,
                    marker=_MARKERS[state],
                    facecolors="none" if hollow else STATE_COLORS[state],
                    edgecolors=STATE_COLORS[state] if hollow else _INK,
                    linewidths=0.7,
                    zorder=5,
                )
        axis.set_title(f"{method}: {int(of_method.sum())} misclassified", fontsize=10)
        axis.set_axis_off()
    for axis in axes[len(methods) :]:
        axis.set_axis_off()
    handles = [
        Line2D([], [], linestyle="", marker=_MARKERS[state], color=STATE_COLORS[state], markeredgecolor=_INK)
        for state in STATES
    ]
    handles.append(Line2D([], [], linestyle="", marker="o", color="none", markeredgecolor=_INK))
    labels = [*(f"{STATE_WORDS[state]} door" for state in STATES), "hollow: undecidable"]
    outside_legend(figure, handles, labels, "outside lower center")
    return figure


def _door_of(manifest: pd.DataFrame) -> Door:
    """Return the door that all samples of a simulated data set show; for other data sets, the default door."""
    first = {str(name): "" if value != value else str(value) for name, value in manifest.iloc[0].items()}
    shows_one_scene = first.get("scene") and not first.get("scene_id")
    return (unflatten(first).scene.door if shows_one_scene else None) or Door()


def _with_pose(manifest: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with a pose."""
    if not set(_POSE_COLUMNS) <= set(manifest):
        return manifest.iloc[:0]
    return manifest.dropna(subset=list(_POSE_COLUMNS))


def _positions(rows: pd.DataFrame) -> Floats:
    """Return (N, 2) metres in the door frame."""
    return rows[["x_m", "y_m"]].to_numpy(dtype=np.float64)


def _draw_ground(axis: Axes, door: Door, lettering: bool = True) -> None:
    """Draw wall, opening, the leaf at 0, 45 and 90 degrees, rings and region borders."""
    half, thick = door.opening_width_m / 2, door.wall_thickness_m
    for left in (-3.9, half):
        axis.add_patch(
            Rectangle((left, -thick), 3.9 - half, thick, facecolor="#8C8C8C", edgecolor=_INK, linewidth=0.6)
        )
    for angle_deg, alpha in ((0.0, 0.3), (45.0, 1.0), (90.0, 0.3)):
        leaf = leaf_boxes(door.model_copy(update={"handle": None}), Opening(angle_deg=angle_deg))[0]
        width, depth = leaf.size_m[:2]
        corner = (leaf.center_m[0] - width / 2, leaf.center_m[1] - depth / 2)
        outline = Rectangle(
            corner,
            width,
            depth,
            angle=math.degrees(leaf.yaw_rad),
            rotation_point="center",
            facecolor="#7A4B1E",
            alpha=alpha,
            linewidth=0,
        )
        axis.add_patch(outline)
    bearing = np.linspace(0.0, math.pi, 181)
    for radius in _RINGS_M:
        axis.plot(radius * np.cos(bearing), radius * np.sin(bearing), color=_FAINT, linewidth=0.7, zorder=1)
        if lettering:  # in the strip along the wall where no robot stands
            axis.text(radius, 0.3, f"{radius:.1f} m", fontsize=7, ha="center", va="center", bbox=_PLATE)
    for border_deg in sorted({edge for edges in REGIONS.values() for edge in edges} - {0, 180}):
        ray = _ray(border_deg)
        axis.plot(
            *np.stack([_RINGS_M[0] * ray, _RINGS_M[-1] * ray]).T,
            color=_INK,
            linewidth=0.7,
            linestyle="--",
            zorder=2,
        )
    axis.set_aspect("equal")
    if lettering:
        axis.set(xlim=(-4.6, 4.6), ylim=(-0.4, 4.3))
    else:
        axis.set(xlim=(-4.0, 4.0), ylim=(-0.25, 3.6))


def _ray(angle_deg: float) -> NDArray[np.float64]:
    angle_rad = math.radians(angle_deg)
    return np.array([math.cos(angle_rad), math.sin(angle_rad)])


def _label_region(axis: Axes, name: str, count: int) -> None:
    low, high = REGIONS[name]
    x, y = 3.68 * _ray((low + high) / 2)
    side = "center" if name == "green" else "left" if x > 0 else "right"
    text = f"{name}\n{low:g}–{high:g}°\n{count} poses"
    axis.text(x, y, text, fontsize=8, ha=side, va="bottom" if name == "green" else "center")
