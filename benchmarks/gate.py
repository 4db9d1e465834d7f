# SPDX-License-Identifier: Apache-2.0
"""What the gate refuses, and what becomes "open" with and without it, when data of known doors go missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.clouds import comparison_frames
from benchmarks.store import Group
from doorstate._jobs import Progress
from doorstate.clouds.measured import is_measured
from doorstate.evaluation.table import Table
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.row import Row
from doorstate.types import Part, Points

Fault = Callable[[Row, Frame, np.random.Generator], Points]


def without(cloud: Points, missing: NDArray[np.bool_]) -> Points:
    """The cloud (H, W, 3) with NaN where (H, W) is missing."""
    cut = cloud.copy()
    cut[missing] = np.nan
    return cut


def glass(row: Row, frame: Frame) -> Points:
    """The frame as if the leaf, and the leaf's place in its frame, gave no return."""
    shut = replay(row.model_copy(update={"opening_angle_deg": 0.0}))
    return without(frame.points, (shut.full.part == Part.LEAF) | (frame.full.part == Part.LEAF))


def _band(first: float, last: float, axis: int) -> Fault:
    """Loses what is between two shares of the image's height (axis 0) or width (axis 1)."""

    def fault(row: Row, frame: Frame, generator: np.random.Generator) -> Points:
        shape = frame.points.shape[:2]
        place = np.indices(shape)[axis] / shape[axis]
        return without(frame.points, (place >= first) & (place < last))

    return fault


def _dropout(share: float, columns: bool) -> Fault:
    """Loses a share of all pixels, or of all columns."""

    def fault(row: Row, frame: Frame, generator: np.random.Generator) -> Points:
        height, width = frame.points.shape[:2]
        lost = generator.random(width if columns else (height, width)) < share
        return without(frame.points, np.broadcast_to(lost, (height, width)))

    return fault


FAULTS: dict[str, Fault] = {
    "none": lambda row, frame, generator: frame.points,
    "left half missing": _band(0.0, 0.5, 1),
    "right half missing": _band(0.5, 1.0, 1),
    "middle half missing": _band(0.25, 0.75, 1),
    "middle fifth missing": _band(0.4, 0.6, 1),
    "upper half missing": _band(0.0, 0.5, 0),
    "lower half missing": _band(0.5, 1.0, 0),
    "nine tenths of the columns missing": _dropout(0.9, columns=True),
    "half of the pixels missing": _dropout(0.5, columns=False),
    "glass leaf": lambda row, frame, generator: glass(row, frame),
}


def measure(network: str, count: int, progress: Progress) -> list[Group]:
    """Answers of packaged weights, with and without gate, on doors they were not trained on, with every fault."""
    predictor = NetworkPredictor.from_weights(network)
    careless = NetworkPredictor(predictor.backend, gate=None)
    rows = []
    for number, (row, frame) in enumerate(comparison_frames(count, progress)):
        for name, fault in FAULTS.items():
            cloud = fault(row, frame, np.random.default_rng(number))
            flat = cloud[is_measured(cloud)]
            rows.append(
                {
                    "sample_id": row.sample_id,
                    "state": row.state,
                    "fault": name,
                    "gated": _told(predictor, cloud),
                    "gated_flat": _told(predictor, flat),
                    "careless": _told(careless, cloud),
                }
            )
    return rows


def gate_table(rows: Sequence[Group]) -> Table:
    """A line for each fault: how many clouds are refused, and doors that became open."""
    lines = []
    for fault in FAULTS:
        those = [row for row in rows if row["fault"] == fault]
        refused = [
            f"{sum(row[form] is None for row in those)} of {len(those)}" for form in ("gated", "gated_flat")
        ]
        shut = [row for row in those if row["state"] != "open"]
        opened = [
            str(sum(row[form] == "open" for row in shut)) for form in ("gated", "gated_flat", "careless")
        ]
        lines.append((fault, *refused, str(len(shut)), *opened))
    return Table(
        "What the gate refuses",
        (
            "fault",
            "refused",
            "refused, flat",
            "doors not open",
            "called open",
            "called open, flat",
            "called open without the gate",
        ),
        tuple(lines),
        "Packaged weights on simulated doors that they were not trained on, each with every fault, organized and as a "
        "flat list of what was measured.",
    )


def _told(predictor: Predictor, cloud: Points) -> str | None:
    state = predictor(cloud).state
    return None if state is None else state.label
