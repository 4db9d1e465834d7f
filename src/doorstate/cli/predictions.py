# SPDX-License-Identifier: Apache-2.0
"""Who answers, by the options that ask for it, and how `predict` shows an answer, of a file or of a message."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.deployment.predictor import Predictor
    from doorstate.deployment.rule_predictor import RulePredictor


def load_predictor(
    network: str, weights: Path | None, rule: str | None, points: int | None
) -> Predictor | RulePredictor:
    """What the options of the same names ask for, ready for the first cloud."""
    from doorstate.deployment.predictor import Predictor
    from doorstate.deployment.rule_predictor import RulePredictor
    from doorstate.training.environment import keep_freed_memory

    if rule is not None and (weights is not None or points is not None):
        raise ConfigError("--rule has no weights and looks at all points: leave --weights and --points out")
    keep_freed_memory()
    predictor = Predictor.load(weights or network, points) if rule is None else RulePredictor.load(rule)
    predictor.warm_up()
    return predictor


def table_cells(answer: dict[str, Any]) -> list[str]:
    """A described prediction as cells: state, probabilities, points, milliseconds."""
    said = answer["state"] or f"none: {answer['reason']}"
    odds = [f"{probability:.3f}" for probability in answer["probabilities"].values()]
    return [said, *odds, str(answer["points"]), f"{answer['milliseconds']:.0f}"]
