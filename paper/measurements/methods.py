# SPDX-License-Identifier: Apache-2.0
"""Packaged weights and every rule, by name."""

from __future__ import annotations

from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.rules import list_rules


def all_methods(network: str) -> dict[str, Predictor]:
    """Return a predictor for packaged weights and one for each rule."""
    methods: dict[str, Predictor] = {network: NetworkPredictor.from_weights(network)}
    return methods | {name: RulePredictor.from_name(name) for name in list_rules()}
