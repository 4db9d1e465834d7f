# SPDX-License-Identifier: Apache-2.0
"""Settings of simulated data sets."""

from __future__ import annotations

import pytest

from doorstate.errors import ConfigError
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import SimulationSettings, settings_for


def test_settings_by_the_name_of_the_preset() -> None:
    expected = SimulationSettings(preset=PRESETS["ogurob"], seed=1, poses=60)
    assert settings_for("ogurob", 1, poses=60) == expected
    assert settings_for("varied", 0).indices() == list(range(1000))
    assert settings_for("no-door", 0, scenes=7).indices() == list(range(7))
    assert settings_for("varied", 0, scenes=5, sensor="xtion").sensor == "xtion"


@pytest.mark.parametrize(
    ("arguments", "field", "suggestions"),
    [
        ({"preset": "varied", "poses": 5}, "poses", {"scenes": 5}),
        ({"preset": "ogurob", "scenes": 5}, "scenes", {"poses": 5}),
        ({"preset": "ogurob", "poses": 1354}, "poses", {}),
        ({"preset": "varied", "scenes": 0}, "scenes", {}),
        ({"preset": "varies"}, "preset", {}),
        ({"preset": "varied", "sensor": "xtions"}, "sensor", {}),
    ],
)
def test_impossible_settings_are_refused(arguments: dict, field: str, suggestions: dict) -> None:
    with pytest.raises(ConfigError) as refused:
        settings_for(seed=0, **arguments)
    assert refused.value.field == field
    assert refused.value.suggestions == suggestions
