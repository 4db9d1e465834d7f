# SPDX-License-Identifier: Apache-2.0
"""A rule behind the interface of a `Predictor`: no weights, no training, and no answer where it has none."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from doorstate.clouds.preparation import check_one_cloud
from doorstate.inference.gate import Gate
from doorstate.inference.predictor import DEFAULT_GATE, Prediction
from doorstate.rules import create_rule
from doorstate.rules.base import Rule, RuleResult, measured
from doorstate.types import STATES, Points


class RulePredictor:
    """A rule of `doorstate.rules.list_rules()`.

    Args:
        rule: which one.
        gate: as of a `Predictor`: a rule would take missing data for a free way as well.
    """

    def __init__(self, rule: Rule[Any], *, gate: Gate | None = DEFAULT_GATE) -> None:
        self.rule = rule
        self.gate = gate

    @classmethod
    def load(cls, name: str, *, gate: Gate | None = DEFAULT_GATE) -> RulePredictor:
        """A rule by name, with its default parameters.

        Args:
            name: of `doorstate.rules.list_rules()`.
            gate: as of the class.

        Raises:
            ConfigError: no such rule.
        """
        return cls(create_rule(name), gate=gate)

    def __str__(self) -> str:
        return f"rule {self.rule.name}"

    def __call__(self, points: Points) -> Prediction:
        """State of the door in a cloud, or none with the reason; a given state has probability 1.

        Args:
            points: (N, 3) or organized (H, W, 3) metres, x forward, y left, z up, NaN where nothing was measured.

        Raises:
            CloudContentError: no cloud.
        """
        started = time.perf_counter()
        points = check_one_cloud(points)
        count = len(measured(points))
        if count == 0:
            return Prediction.abstain("nothing was measured: the cloud holds no points")
        refused = None if self.gate is None else self.gate(points)
        answer = self.rule(np.asarray(points)) if refused is None else RuleResult.abstain(refused)
        return Prediction(
            answer.state,
            {state: float(answer.state is not None and answer.state.label == state) for state in STATES},
            count,
            (time.perf_counter() - started) * 1000,
            answer.reason,
            answer.opening_angle_deg,
            opening_width_m=answer.opening_width_m,
            detections=answer.detections,
        )
