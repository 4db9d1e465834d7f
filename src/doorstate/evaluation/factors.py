# SPDX-License-Identifier: Apache-2.0
"""Accuracy by factor (opening angle, distance, occlusion, ...) and by kind of sample."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from doorstate.evaluation.manifest import number_values, text_values
from doorstate.evaluation.metrics import Floats
from doorstate.evaluation.results import Results
from doorstate.types import Indices


class Factor(NamedTuple):
    """Quantity of a sample, and the edges of the bins in which accuracy is reported."""

    title: str
    value: Callable[[pd.DataFrame], pd.Series[float]]  # NaN where the manifest does not record it
    edges: tuple[float, ...]


def _column(name: str) -> Callable[[pd.DataFrame], pd.Series[float]]:
    return lambda frame: number_values(frame, name)


def _heading_offset_deg(frame: pd.DataFrame) -> pd.Series[float]:
    """Return the heading relative to the door's middle in degrees, to the left of it positive."""
    bearing_deg = np.degrees(np.arctan2(-number_values(frame, "y_m"), -number_values(frame, "x_m")))
    difference = number_values(frame, "heading_deg") - bearing_deg
    # As math.remainder: to the nearest multiple, so that the result lies within 180 degrees.
    offset: pd.Series[float] = difference - 360 * (difference / 360).round()
    return offset


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
    Factor("heading beside the door's middle, degrees", _heading_offset_deg, tuple(range(-20, 21, 5))),
    Factor("camera height, m", _column("camera_height_m"), (0.25, 0.4, 0.6, 0.8, 1.0, 1.2)),
    Factor("camera pitch, degrees", _column("pitch_deg"), (-10, -6, -2, 2, 6, 10)),
    Factor("pixels of the leaf", _column("visible_leaf_px"), (0, 5e3, 1e4, 2e4, 3e4, 4e4, 6e4, 1e5, 2e5)),
    Factor(OCCLUSION, _column("occluded_share"), (0, 0.01, 0.25, 0.5, 0.75, 1)),
    Factor(
        SHARE,
        lambda frame: 100 * number_values(frame, "opening_share"),
        (0, 3, 11.5, 20, 35, 50, 65, 72.5, 80, 90, 100),
    ),
)


def score_factors(results: Results) -> pd.DataFrame:
    """Return accuracy by bin of each factor that differs between samples; empty bins are left out.

    Returns:
        Columns method, factor, low, high, samples, correct, accuracy. A value on an edge belongs to the bin above it,
        on the last edge to the last bin.
    """
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        correct = tested["correct"].to_numpy()
        for factor in FACTORS:
            bins = _bins(np.asarray(factor.value(tested), dtype=np.float64), factor.edges)
            if len(set(bins[bins >= 0])) < 2:
                continue
            for index, (low, high) in enumerate(zip(factor.edges, factor.edges[1:], strict=False)):
                inside = bins == index
                if inside.any():
                    rows.append((method, factor.title, low, high, inside.sum(), correct[inside].sum()))
    columns = ["method", "factor", "low", "high", "samples", "correct"]
    frame = pd.DataFrame(rows, columns=columns).astype({"low": "float64", "high": "float64"})
    return frame.assign(accuracy=frame["correct"] / frame["samples"])


def _bins(values: Floats, edges: tuple[float, ...]) -> Indices:
    """Return the bin of each value, -1 outside of all."""
    bins = np.searchsorted(edges, values, side="right") - 1
    bins[values == edges[-1]] = len(edges) - 2
    bins[np.isnan(values) | (values > edges[-1])] = -1
    return bins


def preset_of(frame: pd.DataFrame) -> pd.Series[str]:
    """Return the preset of the scene of each row, "" where the manifest names no scene."""
    preset: pd.Series[str] = (
        text_values(frame, "scene_id").str.rsplit("-", n=2).str[0]
    )  # of PRESET-SEED-INDEX
    return preset


def _sensor_and_preset(frame: pd.DataFrame) -> pd.Series[str]:
    """Return sensor and preset: one sensor may have seen the scenes of several presets."""
    preset = preset_of(frame)
    sensor = text_values(frame, "sensor")
    return sensor.where((sensor == "") | (preset == ""), sensor + ", " + preset)


KINDS: dict[str, Callable[[pd.DataFrame], pd.Series[str]]] = {
    "door_kind": lambda frame: text_values(frame, "door_kind"),
    "swing": lambda frame: text_values(frame, "swing"),
    "sensor, preset": _sensor_and_preset,
    "occluded_bin": lambda frame: text_values(frame, "occluded_bin"),
    "ambiguous": lambda frame: text_values(frame, "ambiguous"),
}
"""Kinds of samples: a name, and the value of each row, "" where the manifest does not record it."""


def score_kinds(results: Results) -> pd.DataFrame:
    """Return accuracy by kind of sample: columns method, kind, value, samples, correct, accuracy."""
    rows = []
    for method in results.methods:
        tested = results.tested_by(method)
        for kind, values_of in KINDS.items():
            values = values_of(tested)
            kinds = sorted(set(values) - {""})
            for value in kinds if len(kinds) > 1 else ():
                correct = tested.loc[values == value, "correct"]
                rows.append((method, kind, value, len(correct), int(correct.sum())))
    frame = pd.DataFrame(rows, columns=["method", "kind", "value", "samples", "correct"])
    return frame.assign(accuracy=frame["correct"] / frame["samples"])
