# SPDX-License-Identifier: Apache-2.0
"""Rule behind the interface of a predictor: no weights, no training, and all points are evaluated."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from doorstate.clouds.shape import check_single_cloud
from doorstate.errors import TooFewPointsError
from doorstate.inference.abstention import Abstention
from doorstate.inference.gate import DEFAULT_GATE, Gate
from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.rules import create_rule
from doorstate.rules.base import Rule, measured_points
from doorstate.types import Points


class RulePredictor(Predictor):
    """Rule of `doorstate.rules.list_rules()`.

    Args:
        rule: method to apply.
        gate: rejects clouds in which too much is missing; a rule would take missing data for a free way as well.
        remove_outliers: remove outliers before gate and rule.
    """

    def __init__(
        self, rule: Rule[Any], *, gate: Gate | None = DEFAULT_GATE, remove_outliers: bool = True
    ) -> None:
        self.rule = rule
        self.gate = gate
        self.removes_outliers = remove_outliers

    @classmethod
    def from_name(cls, name: str, *, gate: Gate | None = DEFAULT_GATE) -> RulePredictor:
        """Create a rule with its default parameters.

        Raises:
            ConfigError: no such rule.
        """
        return cls(create_rule(name), gate=gate)

    @property
    def name(self) -> str:
        return self.rule.name

    def __str__(self) -> str:
        return f"rule {self.name}"

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        self._check_hint(known)
        return [self._apply(cloud) for cloud in clouds]

    def _apply(self, cloud: Points) -> Prediction:
        """Return the prediction of one cloud; there are no probabilities."""
        started = time.perf_counter()
        clean = self._clean(check_single_cloud(cloud))
        num_points = len(measured_points(clean.points))
        if num_points == 0:
            error = TooFewPointsError("nothing was measured: the cloud holds no points")
            return Prediction.abstain(Abstention.from_error(error))
        abstention = self._gate(clean)
        if abstention is not None:
            return Prediction.abstain(abstention, num_points, _milliseconds_since(started))
        result = self.rule(clean.points)
        milliseconds = _milliseconds_since(started)
        if result.state is None:
            abstention = Abstention("no_rule_result", message=result.reason)
            return Prediction(None, num_points, milliseconds, abstention, detections=result.detections)
        prediction = Prediction(
            state=result.state,
            num_points=num_points,
            milliseconds=milliseconds,
            opening_angle_deg=result.opening_angle_deg,
            opening_width_m=result.opening_width_m,
            detections=result.detections,
        )
        return self._confirm(prediction, clean)


def _milliseconds_since(started_s: float) -> float:
    return (time.perf_counter() - started_s) * 1000
