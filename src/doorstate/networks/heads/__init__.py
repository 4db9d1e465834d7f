# SPDX-License-Identifier: Apache-2.0
"""Heads: outputs of a network besides the state. Imports no torch.

The numbers of a head have three forms. *Outputs* leave its last linear layer. *Values* are decoded outputs, and
targets, in the network's units and axes: clouds are centred and scaled (clouds.normalization), angles are in radians.
*Columns* are values in metres and degrees in the frame of the cloud, named as in tables. NaN is a number that the
manifest does not hold.

A new head is one `HeadSpec` in a file of its own, entered in `HEADS`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.clouds.normalization import Placement
from doorstate.networks.heads.angle import ANGLE_HEAD
from doorstate.networks.heads.door import DOOR_HEAD
from doorstate.networks.heads.frame import FRAME_HEAD
from doorstate.networks.heads.hinge import HINGE_HEAD
from doorstate.networks.heads.parts import PARTS_HEAD
from doorstate.networks.heads.spec import (
    Column,
    Columns,
    Floats,
    HeadSpec,
    ManifestRow,
    Metric,
    PointHeadSpec,
    Values,
)
from doorstate.networks.heads.widths import WIDTHS_HEAD

__all__ = ["HEADS", "IGNORE_INDEX", "POINT_HEADS", "STATE", "Column", "HeadSpec", "Metric", "PointHeadSpec"]

HEADS = {head.name: head for head in (DOOR_HEAD, ANGLE_HEAD, HINGE_HEAD, FRAME_HEAD, WIDTHS_HEAD)}
"""Heads with one vector per cloud, by name."""
POINT_HEADS = {head.name: head for head in (PARTS_HEAD,)}
"""Heads with one class per point, by name."""
STATE = "state"
"""Name of the output of the network's own classification head."""
IGNORE_INDEX = -100
"""Label of a cloud without a door, or of a door of unknown state; torch's cross entropy skips it."""


def head_targets(
    rows: Sequence[ManifestRow], placement: Placement, heads: Sequence[str] = tuple(HEADS)
) -> dict[str, Values]:
    """Return (M, num_values) targets by head.

    Args:
        rows: M lines of a manifest.
        placement: of their clouds.
        heads: names; those without an entry in `HEADS` are skipped.
    """
    return {name: HEADS[name].target(rows, placement) for name in heads if name in HEADS}


def augment_targets(targets: Mapping[str, Values], draw: AugmentationDraw | None) -> dict[str, Values]:
    """Return the targets of clouds that are changed by a draw; None changes nothing."""
    if draw is None:
        return dict(targets)
    return {name: HEADS[name].augment(target, draw).astype(np.float32) for name, target in targets.items()}


def head_columns(values: Mapping[str, NDArray[np.floating]], placement: Placement) -> Columns:
    """Return (M,) numbers in metres and degrees in the frame of the clouds, by column name.

    Args:
        values: (M, num_values) decoded outputs by head.
        placement: of the M clouds.
    """
    columns: Columns = {}
    for name, head in HEADS.items():
        if name in values:
            numbers = head.to_columns(values[name].astype(np.float64), placement)
            columns |= zip(head.column_names, numbers.T, strict=True)
    return columns


def head_metrics(columns: Mapping[str, Floats], rows: Sequence[ManifestRow]) -> dict[str, float]:
    """Return all metrics of all heads by name; NaN for heads without columns, or if no sample counts.

    Args:
        columns: (M,) numbers by column name, as `head_columns` returns them.
        rows: M lines of the manifest.
    """
    states = np.array([row["state"] for row in rows])
    metrics: dict[str, float] = {}
    for head in HEADS.values():
        if all(name in columns for name in head.column_names):
            numbers = np.stack([columns[name] for name in head.column_names], axis=1)
            truth = head.truth(rows)
            metrics |= {metric.name: metric.compute(numbers, truth, states) for metric in head.metrics}
        else:
            metrics |= {metric.name: math.nan for metric in head.metrics}
    return metrics
