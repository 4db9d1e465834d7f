# SPDX-License-Identifier: Apache-2.0
"""Samples of each state and region, picture above and cloud below (the paper's Figure 2)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.strata import REGIONS
from doorstate.evaluation.manifest import manifest_frame
from doorstate.evaluation.strata import has_strata
from doorstate.evaluation.undecidable import is_undecidable
from doorstate.evaluation.views import (
    REGION_COLORS,
    oblique_view,
    outside_legend,
    picture_axes,
    point_colors,
)
from doorstate.pages.colors import PART_COLORS, STATE_WORDS
from doorstate.types import STATES, Part

_MIDDLE_M = 2.25
_DRAWN_POINTS = 2048


def samples_figure(dataset: PreparedDataset) -> Figure:
    """Draw Figure 2: one sample of each state in each region, or one of each state where regions are unknown."""
    manifest = manifest_frame(dataset.rows)
    regions: Sequence[str] = tuple(REGIONS) if has_strata(manifest) else ("",)
    chosen = [[_typical_sample(manifest, state, region) for region in regions] for state in STATES]
    indices = [index for line in chosen for index in line if index is not None]
    has_pictures = any(dataset.image(index) is not None for index in indices[:1])
    lines_per_state = 2 if has_pictures else 1
    height = 1.75 * lines_per_state * len(STATES) + 0.4
    figure = Figure(figsize=(2.3 * len(regions) + 0.4, height), layout="constrained")
    axes = figure.subplots(lines_per_state * len(STATES), len(regions), squeeze=False)
    for axis in axes.ravel():
        picture_axes(axis)
    for s, state in enumerate(STATES):
        first = lines_per_state * s
        axes[first, 0].set_ylabel(STATE_WORDS[state], fontsize=11)
        for column, index in enumerate(chosen[s]):
            if index is None:
                empty = axes[first, column]
                empty.text(
                    0.5,
                    0.5,
                    "no such sample",
                    transform=empty.transAxes,
                    ha="center",
                    va="center",
                    color="gray",
                )
                continue
            picture = dataset.image(index)
            if picture is not None:
                axes[first, column].imshow(picture[::2, ::2], interpolation="none")
            draw_cloud(axes[first + lines_per_state - 1, column], dataset, index)
    for column, region in enumerate(regions):
        if region:
            low, high = REGIONS[region]
            axes[0, column].set_title(f"{region} {low:g}–{high:g}°", fontsize=10)
            axes[0, column].plot(
                [0, 1],
                [1.02, 1.02],
                transform=axes[0, column].transAxes,
                clip_on=False,
                color=REGION_COLORS[region],
                linewidth=3,
            )
    part_legend(figure, dataset, indices)
    return figure


def _typical_sample(manifest: pd.DataFrame, state: str, region: str) -> int | None:
    """Return the index of a decidable sample near the middle of a region; without regions the first of the state."""
    of_state = manifest["state"] == state
    chosen = manifest[of_state & (manifest["region"] == region)] if region else manifest[of_state]
    if chosen.empty:
        return None
    places = pd.Series(range(len(manifest)), index=manifest.index)
    if not region:
        return int(places[chosen.index[0]])
    low, high = REGIONS[region]
    off_angle = (chosen["robot_angle_deg"] - (low + high) / 2).abs() / (high - low)
    distance = off_angle + (chosen["distance_m"] - _MIDDLE_M).abs()
    order = pd.DataFrame({"undecidable": is_undecidable(chosen), "distance": distance})
    return int(places[order.sort_values(["undecidable", "distance"], kind="stable").index[0]])


def _drawn_parts(dataset: PreparedDataset, index: int) -> NDArray[np.uint8]:
    """Return the parts of the drawn points; empty where they are unknown."""
    parts = dataset.parts(index, _DRAWN_POINTS)
    return np.empty(0, np.uint8) if parts is None else parts


def draw_cloud(axis: Axes, dataset: PreparedDataset, index: int) -> None:
    """Draw a sample's cloud, seen from above and beside, with its opening angle and distance below."""
    points, parts = dataset.cloud(index, _DRAWN_POINTS), _drawn_parts(dataset, index)
    row = dataset.rows[index]
    colors = point_colors(points, parts if len(parts) else None)
    screen, order = oblique_view(points)
    axis.scatter(screen[order, 0], screen[order, 1], s=1.2, c=colors[order], linewidths=0)
    axis.set_aspect("equal")
    angle, distance = row.get("opening_angle_deg"), row.get("distance_m")
    facts = [
        f"{float(angle):.0f}° open" if angle else "",
        f"{float(distance):.1f} m away" if distance else "",
    ]
    axis.set_xlabel(", ".join(fact for fact in facts if fact), fontsize=8)


def part_legend(figure: Figure, dataset: PreparedDataset, indices: Iterable[int]) -> None:
    """Add a legend of the parts in these samples' clouds below the figure; none where parts are unknown."""
    parts = sorted({part for index in indices for part in _drawn_parts(dataset, index).tolist()})
    if parts:
        handles = [Line2D([], [], marker="o", linestyle="", color=PART_COLORS[Part(part)]) for part in parts]
        names = [Part(part).name.lower() for part in parts]
        outside_legend(figure, handles, names, "outside lower center")
