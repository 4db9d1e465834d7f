# SPDX-License-Identifier: Apache-2.0
"""Whether a robot's quick sampling of some pixels gives the answers of sampling them all, as in training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.clouds import comparison_frames
from benchmarks.store import Group
from doorstate._jobs import Progress
from doorstate.evaluation.table import Table, number
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction


def measure(network: str, count: int, progress: Progress) -> list[Group]:
    """Answers of packaged weights to doors they were not trained on, with both samplings."""
    samplings = {
        "some": NetworkPredictor.from_weights(network),
        "all": NetworkPredictor.from_weights(network, thin=False),
    }
    rows = []
    for row, frame in comparison_frames(count, progress):
        answers = {name: predict(frame.points) for name, predict in samplings.items()}
        rows.append({"truth": row.state} | {k: _told(v) for k, v in answers.items()})
    return rows


def thinning_table(rows: Sequence[Group]) -> Table:
    """One line: how many answers agree, how many of each are right, how far probabilities are apart."""
    some, every = ([row[name] for row in rows] for name in ("some", "all"))
    truth = [row["truth"] for row in rows]
    agree = sum(a["state"] == b["state"] for a, b in zip(some, every, strict=True))
    right = [sum(a["state"] == t for a, t in zip(answers, truth, strict=True)) for answers in (some, every)]
    apart = [
        max(abs(a["probabilities"][s] - b["probabilities"][s]) for s in a["probabilities"])
        for a, b in zip(some, every, strict=True)
    ]
    return Table(
        "Sampling from some pixels and from all",
        ("clouds", "same answer", "right, some", "right, all", "median difference", "largest difference"),
        (
            (
                str(len(rows)),
                str(agree),
                *map(str, right),
                number(float(np.median(apart))),
                number(max(apart)),
            ),
        ),
        "Packaged weights on simulated doors that they were not trained on; differences are of the probability that "
        "differs most.",
    )


def _told(answer: Prediction) -> Group:
    state = None if answer.state is None else answer.state.label
    return {"state": state, "probabilities": answer.probabilities}
