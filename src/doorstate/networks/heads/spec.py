# SPDX-License-Identifier: Apache-2.0
"""Description of a head: columns, target, loss, decoding and metrics in one value."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from doorstate.clouds.augmentation import AugmentationDraw
from doorstate.clouds.normalization import Placement

if TYPE_CHECKING:
    from torch import Tensor

Floats = NDArray[np.float64]
Values = NDArray[np.float32]
States = NDArray[np.str_]
ManifestRow = Mapping[str, Any]
"""Line of a manifest, text or numbers by column; "" or None is a missing value."""
Columns = dict[str, Floats]
"""(M,) numbers by column name."""


@dataclass(frozen=True)
class Column:
    """Column of a table of head outputs, and where a manifest holds its true value."""

    name: str
    unit: str  # "m", "deg", or "" for a probability
    manifest: str = ""  # column of the manifest; the same name if empty
    parse: Callable[[Any], float] = float

    @property
    def source(self) -> str:
        """Column of the manifest with the true value."""
        return self.manifest or self.name

    def truth(self, rows: Sequence[ManifestRow]) -> Floats:
        """Return the (M,) true values of manifest rows, NaN where there is none."""
        cells = (row.get(self.source) for row in rows)
        return np.array([math.nan if cell in (None, "") else self.parse(cell) for cell in cells])


@dataclass(frozen=True)
class Metric:
    """Figure of merit of a head.

    `compute` takes (M, C) columns, (M, C) true columns and (M,) states; it returns NaN if no sample counts.
    """

    name: str
    title: str
    digits: int
    compute: Callable[[Floats, Floats, States], float]


def _identity(values: Floats, placement: Placement) -> Floats:
    return values


def _invariant(target: Values, draw: AugmentationDraw) -> Values:
    return target


@dataclass(frozen=True)
class HeadSpec:
    """Head that predicts one small vector per cloud.

    Args:
        name: name in configurations, weights cards and exported files.
        description: meaning of the values, for users of an exported file.
        columns: columns of the table of outputs, one for each value.
        num_outputs: size of the last linear layer.
        decode: (B, num_outputs) outputs to (B, num_values) values.
        loss: (B, num_outputs) outputs and (B, num_values) targets without NaN to (B,) losses.
        metrics: figures of merit.
        to_values: (M, num_values) columns and the placement of M clouds to values.
        to_columns: inverse of `to_values`.
        augment: (B, num_values) targets of clouds that are changed by a draw.
    """

    name: str
    description: str
    columns: tuple[Column, ...]
    num_outputs: int
    decode: Callable[[Tensor], Tensor]
    loss: Callable[[Tensor, Tensor], Tensor]
    metrics: tuple[Metric, ...]
    to_values: Callable[[Floats, Placement], Floats] = _identity
    to_columns: Callable[[Floats, Placement], Floats] = _identity
    augment: Callable[[Values, AugmentationDraw], NDArray[np.floating]] = _invariant

    @property
    def num_values(self) -> int:
        """Numbers per cloud after `decode`, and in a target."""
        return len(self.columns)

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(column.name for column in self.columns)

    def truth(self, rows: Sequence[ManifestRow]) -> Floats:
        """Return the (M, num_values) true columns of manifest rows, NaN where unknown."""
        return np.stack([column.truth(rows) for column in self.columns], axis=1)

    def target(self, rows: Sequence[ManifestRow], placement: Placement) -> Values:
        """Return the (M, num_values) targets of samples whose clouds were normalised with this placement."""
        return self.to_values(self.truth(rows), placement).astype(np.float32)


@dataclass(frozen=True)
class PointHeadSpec:
    """Head that classifies every point; its layers belong to the network (`PointNetwork.part_branch`).

    Args:
        name: name in configurations, weights cards and run folders.
        classes: names of the classes.
        target: (M, n) stored classes to (M, n) int64 targets, negative where unknown.
        loss: (B, n, C) logits and (B, n) targets to a scalar, the mean over the points with a target.
        confusion: (B, n) targets and (B, n) predicted classes to (C, C) counts by true and predicted class.
        metric: (C, C) counts to (C,) figures of merit by class.
    """

    name: str
    classes: tuple[str, ...]
    target: Callable[[NDArray[np.uint8]], NDArray[np.int64]]
    loss: Callable[[Tensor, Tensor], Tensor]
    confusion: Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.int64]]
    metric: Callable[[NDArray[np.int64]], Floats]
