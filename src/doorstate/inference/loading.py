# SPDX-License-Identifier: Apache-2.0
"""Who answers: packaged weights, a file of weights or a rule, ready for the first cloud."""

from __future__ import annotations

from pathlib import Path

from doorstate._memory import keep_freed_memory
from doorstate.errors import ConfigError
from doorstate.inference.gate import Gate
from doorstate.inference.predictor import DEFAULT_GATE, DEFAULT_NETWORK, Predictor
from doorstate.inference.rule_predictor import RulePredictor


def load_predictor(
    network: str | None = None,
    weights: Path | None = None,
    rule: str | None = None,
    points: int | None = None,
    *,
    budget_ms: float | None = None,
    gate: Gate | None = DEFAULT_GATE,
    threads: int | None = None,
) -> Predictor | RulePredictor:
    """Load and warm up.

    Args:
        network: whose packaged weights answer; `DEFAULT_NETWORK` if nobody is named.
        weights: a file in place of them.
        rule: in place of a network.
        points: as of `Predictor.load`, like what follows.
        budget_ms: in place of points.
        gate: refuses clouds in which too much is missing.
        threads: for one answer.

    Raises:
        ConfigError: options that exclude each other, or no such rule.
        WeightsError: no such weights, or they cannot be used.
        MissingExtraError: what the weights need is not installed.
    """
    if sum(each is not None for each in (network, weights, rule)) > 1:
        raise ConfigError("one answers: give a network, a weights file or a rule")
    keep_freed_memory()
    if rule is None:
        predictor = Predictor.load(
            weights or network or DEFAULT_NETWORK, points, gate=gate, budget_ms=budget_ms, threads=threads
        )
        predictor.warm_up()
        return predictor
    if points is not None or budget_ms is not None:
        raise ConfigError("a rule looks at all points: leave points and time budget out")
    return RulePredictor.load(rule, gate=gate)
