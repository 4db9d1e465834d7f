# SPDX-License-Identifier: Apache-2.0
"""Model cards: one page beside each weights file of the package."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from doorstate._documents import read_json
from doorstate.clouds.augmentation import Augmentation
from doorstate.evaluation.heads import head_errors, head_rows, score_four_labels, with_finder
from doorstate.evaluation.method_scores import MACRO, score_states
from doorstate.evaluation.results import Results
from doorstate.networks.card import Guarantee, HeadErrors, WeightsCard
from doorstate.networks.door_calibration import DoorCalibration
from doorstate.training.run_folder import RunFolder
from doorstate.types import STATES

from .paths import TITLES


@dataclass(frozen=True)
class Evidence:
    """Published scores of weights or of their recipe.

    Attributes:
        temperature: divides the logits.
        abstain_below: probability below which the weights abstain.
        default_points: number of points that loses nothing; None if no study tells.
        calibration_error: expected calibration error after scaling.
        comparisons: published results to show on the card.
        errors: standard errors of the heads; None where they were not measured.
        door_calibration: probability of a door by network and finder; None for whole clouds.
        guarantee: largest share of wrong answers; None without one.
        answers: counts of tested doors by stratum (`evaluation.answers`); None without threshold.
    """

    temperature: float
    abstain_below: float
    default_points: int | None
    calibration_error: float
    comparisons: tuple[Results, ...]
    errors: HeadErrors | None = None
    door_calibration: DoorCalibration | None = None
    guarantee: Guarantee | None = None
    answers: pd.DataFrame | None = None


@dataclass(frozen=True)
class Training:
    """Facts of a training run that a card names."""

    recipe: Mapping[str, Any]
    start_from: str | None  # experiment
    samples: int
    minutes: float
    environment: Mapping[str, Any]

    @classmethod
    def read(cls, run: RunFolder) -> Training:
        """Read them from the folder of a finished run."""
        config, metrics = read_json(run.config), run.read_metrics()
        start = config.get("start_from")  # .../EXPERIMENT/runs/NETWORK/foldK/weights.safetensors
        return cls(
            config["recipe"],
            Path(start).parents[3].name if start else None,
            int(metrics["train_samples"]),
            metrics["seconds"] / 60,
            read_json(run.environment),
        )


def model_card(path: Path, card: WeightsCard, parameters: int, training: Training, evidence: Evidence) -> str:
    """Return the card of a weights file as Markdown.

    Args:
        path: weights file.
        card: card in the file.
        parameters: number of parameters of the network.
        training: run that trained the weights.
        evidence: published scores.
    """
    from .pages.render import render_template

    data = path.read_bytes()
    unchanged = Augmentation().model_dump(mode="json")
    augmentation = {
        name: value for name, value in training.recipe["augmentation"].items() if value != unchanged[name]
    }
    return render_template(
        "model_card.md.j2",
        {
            "name": path.stem,
            "title": TITLES[card.network],
            "card": card,
            "parameters": parameters,
            "megabytes": len(data) / 1e6,
            "sha256": hashlib.sha256(data).hexdigest(),
            "training": training,
            "augmentation": augmentation,
            "corruption": training.recipe.get("corruption", {}),
            "answers": None if evidence.answers is None else evidence.answers.to_dict("records"),
            "evidence": evidence,
            "states": STATES,
            "scores": [_scores(results, card.network) for results in evidence.comparisons],
            "heads": _heads(evidence.comparisons[0], card) if card.heads else None,
        },
    )


def _scores(results: Results, network: str) -> dict[str, Any]:
    states = score_states(results)
    own = states[states["method"] == network].set_index("state")
    return {
        "protocol": results.config.protocol,
        "samples": len(results.tested_by(network)),
        "f1": own.loc[MACRO, "f1"],
        "recall": own["recall"],
    }


def _heads(results: Results, card: WeightsCard) -> dict[str, float]:
    rows = head_rows(results, card.network)
    four = score_four_labels(results)
    no_door = four.loc[four["method"] == card.network, "no_door"].iloc[0]
    heads = {"no_door": float(no_door), **({} if rows is None else head_errors(rows))}
    if card.door_calibration is not None and rows is not None:
        heads["door_auroc_with_finder"] = head_errors(with_finder(rows, card.door_calibration))["door_auroc"]
    return heads
