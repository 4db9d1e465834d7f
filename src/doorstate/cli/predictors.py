# SPDX-License-Identifier: Apache-2.0
"""Predictor from the options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate.inference.predictor import Predictor


def load_predictor(
    network: str | None = None,
    weights: Path | None = None,
    rule: str | None = None,
    points: int | None = None,
    *,
    budget_ms: float | None = None,
    threads: int | None = None,
) -> Predictor:
    """Load and warm up the network or rule that the options name.

    Raises:
        ConfigError: options exclude each other.
        DoorstateError: see `Predictor.load`.
    """
    from doorstate.inference.predictor import Predictor

    if sum(option is not None for option in (network, weights, rule)) > 1:
        raise ConfigError("--network, --weights and --rule exclude each other")
    predictor = Predictor.load(
        weights or network, rule=rule, num_points=points, budget_ms=budget_ms, threads=threads
    )
    predictor.warm_up()
    return predictor
