# SPDX-License-Identifier: Apache-2.0
"""Agreement of predictions from a part of the pixels with predictions from all pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._jobs import Progress
from doorstate.evaluation.table import Table, number
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction

from .frames import reference_frames


class ThinningResult(NamedTuple):
    """Predictions for one cloud."""

    state: str
    thinned: Prediction
    full: Prediction


def measure_thinning(network: str, count: int, progress: Progress) -> list[ThinningResult]:
    """Return the predictions of packaged weights for simulated doors, with both samplings."""
    thinned = NetworkPredictor.from_weights(network, gate=None)
    full = NetworkPredictor.from_weights(network, thin=False, gate=None)
    return [
        ThinningResult(row.state, thinned(frame.points), full(frame.points))
        for row, frame in reference_frames(count, progress)
    ]


def thinning_table(results: Sequence[ThinningResult]) -> Table:
    """Return one row: equal and correct states, and differences of the probabilities."""
    differences = [
        float(np.abs(_probabilities(result.thinned) - _probabilities(result.full)).max())
        for result in results
    ]
    row = (
        str(len(results)),
        str(sum(result.thinned.state == result.full.state for result in results)),
        str(sum(result.thinned.state == result.state for result in results)),
        str(sum(result.full.state == result.state for result in results)),
        number(float(np.median(differences))),
        number(max(differences)),
    )
    return Table(
        "Sampling from a part of the pixels and from all",
        ("clouds", "same state", "correct, part", "correct, all", "median difference", "largest difference"),
        (row,),
        "Packaged weights on simulated doors that they were not trained on; differences are those of the probability "
        "that differs most.",
    )


def _probabilities(prediction: Prediction) -> NDArray[np.float64]:
    return np.array(list((prediction.raw_probabilities or {}).values()))
