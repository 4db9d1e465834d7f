# SPDX-License-Identifier: Apache-2.0
"""Publish the predictions of the default network and all rules on recorded frames; the frames stay outside."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

from doorstate._files import write_compressed_text, write_text
from doorstate._jobs import Progress
from doorstate.dataset.labelled import labelled_frames
from doorstate.evaluation.frames import evaluate_frames
from doorstate.inference.known import Known
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import DEFAULT_NETWORK, Predictor
from doorstate.rules import list_rules
from doorstate.types import Points

from . import paths

FOLDER = paths.RESULTS / "real"
COLUMNS = (
    "method",
    "sample_id",
    "door",
    "sensor",
    "state",
    "predicted",
    "p_closed",
    "p_semi_open",
    "p_open",
    "p_door",
    "opening_angle_deg",
    "reason",
)


class DoorKnown(Predictor):
    """Method that is told that a door is in view."""

    def __init__(self, method: Predictor) -> None:
        self._method = method

    @property
    def name(self) -> str:
        """Name of the method."""
        return f"{self._method.name}, door known"

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        return self._method._predict(clouds, replace(known, door=True))


def publish_frames(recordings: Path, progress: Progress) -> Path:
    """Evaluate labelled recordings, and write predictions and their origin into results/real.

    Args:
        recordings: folder with an `index.csv`.
        progress: called after each frame.
    """
    network = NetworkPredictor.from_weights(DEFAULT_NETWORK)
    known = DoorKnown(network)
    predictors: dict[str, Predictor] = {DEFAULT_NETWORK: network, known.name: known}
    predictors |= {name: Predictor.load(rule=name) for name in list_rules()}
    frames = labelled_frames(recordings)
    results = evaluate_frames(predictors, frames, progress)
    table = results.joined.rename(columns={"opening_angle_deg_predicted": "opening_angle_deg"})
    for name in ("door", "sensor"):
        table[name] = table[name].fillna("") if name in table else ""
    text = table[list(COLUMNS)].to_csv(index=False, lineterminator="\n", float_format="%.5g")
    write_compressed_text(FOLDER / "predictions.csv.gz", text)
    weights = paths.PRETRAINED / f"{DEFAULT_NETWORK}.safetensors"
    experiment = {
        "name": "real",
        "date": date.today().isoformat(),
        "network": DEFAULT_NETWORK,
        "sha256": hashlib.sha256(weights.read_bytes()).hexdigest(),
        "abstain_below": network.card.abstain_below,
        "recordings": len(frames),
        "unreadable": {frame.file: reason for frame, reason in results.unreadable},
    }
    write_text(FOLDER / "experiment.json", json.dumps(experiment, indent=2) + "\n")
    return FOLDER
