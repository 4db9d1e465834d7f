# SPDX-License-Identifier: Apache-2.0
"""Likeness of every column of a wall to the middle of a doorway, by a small network over the wall's elevation.

The network has 28,000 parameters, takes half a millisecond a wall and was trained on simulated walls (`python -m paper
finder`). It knows edges which no threshold finds: a casing of 5 mm is less than the noise of a pixel, and more than
that of a column.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._onnxruntime import open_session
from doorstate.doorways.elevation import Elevation
from doorstate.doorways.plan_lines import Floats

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

USUAL_WIDTH_M = 0.9
PLACE_SCALE_M, WIDTH_SCALE, DEPTH_SCALE_M, END_SCALE_M = 0.2, 0.3, 0.2, 0.1  # of the outputs
_RELIEF_UNIT_M, _MAX_RELIEF = 0.1, 3.5
_BEHIND_UNIT_M, _MAX_BEHIND, _MAX_BEFORE_M = 2.0, 2.0, 2.0
_MANY_RAYS = 4.0
_DISTANCE_UNIT_M, _MAX_DISTANCE_M = 3.0, 4.0


class Places(NamedTuple):
    """Places along a wall's line that columns propose, with their probabilities, each (columns,)."""

    probability: Floats
    along_m: Floats


class ColumnScores(NamedTuple):
    """Outputs for the columns of a wall."""

    middles: Places  # of doorways
    width_m: Floats  # (columns,)
    behind_m: Floats  # (columns,) of the doorway's plane behind the wall's
    ends: tuple[Places, Places]  # right and left end of doorways, as the camera sees them


def column_features(
    elevation: Elevation, distance_m: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the inputs of the network: of cells (columns, rows, 7), and of columns (columns, 2).

    Args:
        elevation: elevation of a wall.
        distance_m: distance of the camera from the wall's plane.
    """
    rays = np.maximum(elevation.seen, 1)
    cells = np.stack(
        [
            elevation.on_wall / rays,
            np.clip(elevation.relief_m / _RELIEF_UNIT_M, -_MAX_RELIEF, _MAX_RELIEF),
            elevation.through / rays,
            np.clip(elevation.behind_m / _BEHIND_UNIT_M, 0, _MAX_BEHIND),
            elevation.hidden / rays,
            np.clip(elevation.before_m, -_MAX_BEFORE_M, 0),
            np.minimum(elevation.seen / _MANY_RAYS, 1),
        ],
        axis=-1,
    ).astype(np.float32)
    along_m = elevation.positions_m
    nearness = np.full(len(along_m), min(distance_m, _MAX_DISTANCE_M) / _DISTANCE_UNIT_M)
    columns = np.stack([nearness, along_m / np.hypot(along_m, distance_m)], axis=1).astype(np.float32)
    return cells, columns


def score_columns(elevation: Elevation, distance_m: float) -> ColumnScores:
    """Return the scores of all columns of a wall; arguments are those of `column_features`."""
    cells, columns = column_features(elevation, distance_m)
    (outputs,) = _session().run(None, {"cells": cells[None], "columns": columns[None]})
    middle, place, width, depth, left, left_place, right, right_place = np.asarray(outputs, np.float64)[0].T
    along_m = elevation.positions_m

    def places(logit: Floats, offset: Floats, scale_m: float) -> Places:
        return Places(1 / (1 + np.exp(-logit)), along_m + scale_m * offset)

    return ColumnScores(
        middles=places(middle, place, PLACE_SCALE_M),
        width_m=USUAL_WIDTH_M * np.exp(WIDTH_SCALE * width),
        behind_m=DEPTH_SCALE_M * depth,
        ends=(places(right, right_place, END_SCALE_M), places(left, left_place, END_SCALE_M)),
    )


@cache
def _session() -> InferenceSession:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    model = files("doorstate.doorways").joinpath("column_scorer.onnx").read_bytes()
    return open_session(model, options)
