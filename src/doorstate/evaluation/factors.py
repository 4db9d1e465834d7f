# SPDX-License-Identifier: Apache-2.0
"""Accuracy against what changes from sample to sample: opening angle, distance, where the robot stands and looks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.metrics import Floats
from doorstate.evaluation.results import ComparisonResults
from doorstate.evaluation.stratum_tables import rows_of
from doorstate.evaluation.table import Table, number
from doorstate.evaluation.views import NETWORK_COLORS, graph_axes
from doorstate.types import Indices

_FEWEST = 10  # samples of a bin that is drawn


class Factor(NamedTuple):
    """Something the manifest knows of a sample, and the bins it is looked at in."""

    title: str
    value: Callable[[Mapping[str, str]], float]  # NaN where the row does not know
    edges: tuple[float, ...]


class Bin(NamedTuple):
    """One method's answers to the samples of one bin."""

    method: str
    factor: str
    low: float
    high: float
    samples: int
    right: int


def _column(name: str) -> Callable[[Mapping[str, str]], float]:
    return lambda row: float(row.get(name) or math.nan)


def _heading_off_deg(row: Mapping[str, str]) -> float:
    """How far the robot looks past the door's middle, to the left of it positive."""
    if not all(row.get(name) for name in ("x_m", "y_m", "heading_deg")):
        return math.nan
    bearing = math.degrees(math.atan2(-float(row["y_m"]), -float(row["x_m"])))
    return math.remainder(float(row["heading_deg"]) - bearing, 360)


ANGLE, OCCLUSION = "opening angle, degrees", "occluded share of the door"
SHARE = "opened share of a sliding door, %"
FACTORS = (
    Factor(
        ANGLE,
        _column("opening_angle_deg"),
        (0, 3, 9, 15, *range(25, 66, 10), 70, *range(75, 116, 10), 170),
    ),
    Factor("distance to the door, m", _column("distance_m"), tuple(np.arange(1.5, 3.51, 0.25).tolist())),
    Factor(
        "angle between robot and door frame, degrees", _column("robot_angle_deg"), tuple(range(10, 171, 10))
    ),
    Factor("heading beside the door's middle, degrees", _heading_off_deg, tuple(range(-20, 21, 5))),
    Factor("camera height, m", _column("camera_height_m"), (0.25, 0.4, 0.6, 0.8, 1.0, 1.2)),
    Factor("camera pitch, degrees", _column("pitch_deg"), (-10, -6, -2, 2, 6, 10)),
    Factor("pixels of the leaf", _column("visible_leaf_px"), (0, 5e3, 1e4, 2e4, 3e4, 4e4, 6e4, 1e5, 2e5)),
    Factor(OCCLUSION, _column("occluded_share"), (0, 0.01, 0.25, 0.5, 0.75, 1)),
    Factor(
        SHARE,
        lambda row: 100 * _column("opening_share")(row),
        (0, 3, 11.5, 20, 35, 50, 65, 72.5, 80, 90, 100),
    ),
)


def factor_bins(results: ComparisonResults, dataset: PreparedDataset) -> Iterator[Bin]:
    """Every bin that holds samples, of every method and factor; the last edge of a factor belongs to its last bin."""
    for method in results.networks:
        predictions = results.pooled(method)
        rows = rows_of(dataset, predictions)
        right = predictions.true == predictions.predicted
        for factor in FACTORS:
            place = _places(np.array([factor.value(row) for row in rows]), factor.edges)
            if len(set(place[place >= 0])) < 2:
                continue  # the same of every sample
            for index, (low, high) in enumerate(zip(factor.edges, factor.edges[1:], strict=False)):
                inside = place == index
                if inside.any():
                    yield Bin(method, factor.title, low, high, int(inside.sum()), int(right[inside].sum()))


def _places(values: Floats, edges: tuple[float, ...]) -> Indices:
    """Bin of each value, -1 outside."""
    places = np.searchsorted(edges, values, side="right") - 1
    places[values == edges[-1]] = len(edges) - 2
    places[np.isnan(values) | (values > edges[-1])] = -1
    return places


def _sensor(row: Mapping[str, str]) -> str:
    """A sensor and the preset whose scenes it saw: one camera may have seen other scenes than the next."""
    preset = row.get("scene_id", "").rsplit("-", 2)[0]  # of PRESET-SEED-INDEX
    sensor = row.get("sensor", "")
    return f"{sensor}, {preset}" if sensor and preset else sensor


KINDS: dict[str, Callable[[Mapping[str, str]], str]] = {
    "door_kind": lambda row: row.get("door_kind", ""),
    "swing": lambda row: row.get("swing", ""),
    "sensor, preset": _sensor,
    "occluded_bin": lambda row: row.get("occluded_bin", ""),
    "ambiguous": lambda row: row.get("ambiguous", ""),
}
"""What kind of sample a row of the manifest is of, "" where it does not know."""


def kinds_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Right answers by method and kind of sample, for what differs between samples."""
    rows = []
    for method in results.networks:
        predictions = results.pooled(method)
        manifest = rows_of(dataset, predictions)
        for kind, of in KINDS.items():
            values = np.array([of(row) for row in manifest])
            known = sorted(set(values) - {""})
            for value in known if len(known) > 1 else ():
                right = predictions.right[values == value]
                rows.append(
                    (method, kind, value, str(len(right)), str(right.sum()), number(float(right.mean())))
                )
    columns = ("method", "kind", "value", "samples", "right", "accuracy")
    return Table("Accuracy by kind of sample", columns, tuple(rows), text_columns=3)


def factors_table(results: ComparisonResults, dataset: PreparedDataset) -> Table:
    """Right answers by method, factor and bin."""
    rows = tuple(
        (
            each.method,
            each.factor,
            f"{each.low:g}",
            f"{each.high:g}",
            str(each.samples),
            str(each.right),
            number(each.right / each.samples),
        )
        for each in factor_bins(results, dataset)
    )
    columns = ("method", "factor", "from", "to", "samples", "right", "accuracy")
    return Table("Accuracy against one factor at a time", columns, rows, text_columns=2)


def factors_figure(results: ComparisonResults, dataset: PreparedDataset) -> Figure | None:
    """Share of right answers by bin of each factor, a line for each method, rules dashed; None without factors."""
    bins = list(factor_bins(results, dataset))
    titles = [factor.title for factor in FACTORS if any(each.factor == factor.title for each in bins)]
    if not titles:
        return None
    figure = Figure(figsize=(10.0, 3.1 * -(-len(titles) // 2) + 0.6), layout="constrained")
    axes = figure.subplots(-(-len(titles) // 2), 2, squeeze=False, sharey=True).ravel()
    for axis in axes[len(titles) :]:
        axis.remove()
    for axis, title in zip(axes, titles, strict=False):
        for order, method in enumerate(results.networks):
            shown = [
                each
                for each in bins
                if each.method == method and each.factor == title and each.samples >= _FEWEST
            ]
            x, y = _line(shown)
            axis.plot(
                x,
                y,
                "--" if method in results.comparison.rules else "-",
                marker="o",
                markersize=3,
                linewidth=1.2,
                color=NETWORK_COLORS.get(method, f"C{order}" if order < 10 else "black"),
                label=method,
            )
        axis.set_xlabel(title)
        graph_axes(axis)
    for axis in axes[: len(titles) : 2]:
        axis.set_ylabel("accuracy")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(6, len(labels)), frameon=False)
    return figure


def _line(bins: list[Bin]) -> tuple[list[float], list[float]]:
    """Middles and accuracies, with a gap where a bin is missing."""
    x, y = [], []
    for before, each in zip([None, *bins], bins, strict=False):
        if before is not None and before.high != each.low:
            x.append(before.high)
            y.append(math.nan)
        x.append((each.low + each.high) / 2)
        y.append(each.right / each.samples)
    return x, y
