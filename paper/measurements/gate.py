# SPDX-License-Identifier: Apache-2.0
"""Predictions with and without the gate when parts of a cloud are missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._jobs import Progress
from doorstate.clouds.measured import is_measured
from doorstate.evaluation.table import Table
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.simulation.frames import Frame, replay
from doorstate.simulation.row import Row
from doorstate.types import Part, Points

from .dark_leaves import dark_leaf
from .frames import reference_frames

Fault = Callable[[Row, Frame, np.random.Generator], Points]


class GateResult(NamedTuple):
    """States that were predicted for one cloud with one fault; None where the method abstains."""

    sample_id: str
    state: str
    fault: str
    gated: str | None
    gated_flat: str | None  # from a flat list of the measured points
    ungated: str | None


def without(cloud: Points, missing: NDArray[np.bool_]) -> Points:
    """Return the cloud (H, W, 3) with NaN where the mask (H, W) is true."""
    masked = cloud.copy()
    masked[missing] = np.nan
    return masked


def glass(row: Row, frame: Frame) -> Points:
    """Return the cloud without the points of the leaf, and without the area that a closed leaf would cover."""
    closed = replay(row.model_copy(update={"opening_angle_deg": 0.0}))
    return without(frame.points, (closed.full.part == Part.LEAF) | (frame.full.part == Part.LEAF))


def _band(first: float, last: float, axis: int) -> Fault:
    """Return a fault that removes a band of the image, from and to a share of its height (axis 0) or width (axis 1)."""

    def fault(row: Row, frame: Frame, generator: np.random.Generator) -> Points:
        shape = frame.points.shape[:2]
        position = np.indices(shape)[axis] / shape[axis]
        return without(frame.points, (position >= first) & (position < last))

    return fault


def _dropout(share: float, columns: bool) -> Fault:
    """Return a fault that removes a random share of the pixels, or of the columns."""

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
    "dark leaf": lambda row, frame, generator: dark_leaf(frame),
    "glass leaf": lambda row, frame, generator: glass(row, frame),
}


def measure_gate(network: str, count: int, progress: Progress) -> list[GateResult]:
    """Return the predictions of packaged weights for simulated doors with every fault."""
    gated = NetworkPredictor.from_weights(network)
    ungated = type(gated)(gated.backend, gate=None)
    results = []
    for number, (row, frame) in enumerate(reference_frames(count, progress)):
        for fault_name, fault in FAULTS.items():
            cloud = fault(row, frame, np.random.default_rng(number))
            flat = cloud[is_measured(cloud)]
            states = (gated(cloud).state, gated(flat).state, ungated(cloud).state)
            results.append(GateResult(row.sample_id, row.state, fault_name, *states))
    return results


def gate_table(results: Sequence[GateResult]) -> Table:
    """Return one row per fault: rejected clouds, and doors that are not open and were reported open."""
    rows = []
    for fault in FAULTS:
        of_fault = [result for result in results if result.fault == fault]
        not_open = [result for result in of_fault if result.state != "open"]
        rows.append(
            (
                fault,
                f"{sum(result.gated is None for result in of_fault)} of {len(of_fault)}",
                f"{sum(result.gated_flat is None for result in of_fault)} of {len(of_fault)}",
                str(len(not_open)),
                str(sum(result.gated == "open" for result in not_open)),
                str(sum(result.gated_flat == "open" for result in not_open)),
                str(sum(result.ungated == "open" for result in not_open)),
            )
        )
    return Table(
        "Rejections of the gate",
        (
            "fault",
            "rejected",
            "rejected, flat",
            "doors not open",
            "reported open",
            "reported open, flat",
            "reported open without the gate",
        ),
        tuple(rows),
        "Packaged weights on simulated doors that they were not trained on, each with every fault; as an organized "
        "cloud, and as a flat list of the measured points.",
    )
