# SPDX-License-Identifier: Apache-2.0
"""Scenes of buildings through the whole path: drawn, rendered, sensed, candidates found, cropped and labelled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.crops import Crops
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.simulated import simulate_prepared
from doorstate.simulation.presets import PresetName
from doorstate.simulation.settings import settings_for
from doorstate.types import NO_DOOR


@pytest.mark.parametrize(("name", "scenes"), [("building", 2), ("building-no-door", 3)])
def test_scenes_of_buildings_give_crops(name: PresetName, scenes: int, tmp_path: Path) -> None:
    settings = settings_for(name, 3, scenes=scenes, sensor="xtion")
    raw, prepared = tmp_path / "raw", tmp_path / "prepared"
    preparation = Preparation(raw, CloudSpec(num_points=128, thin=True), crops=Crops(add_missed=True))
    data = simulate_prepared(settings, preparation, prepared, 1).dataset
    assert data.description.input == "doorway"
    assert np.isfinite(np.asarray(data.clouds)).all()
    states = {row["state"] for row in data.rows}
    assert states == {NO_DOOR} if name == "building-no-door" else len(states - {NO_DOOR}) >= 2
    kinds = {row["scene_kind"] for row in data.rows}
    assert (kinds == {"door"}) == (name == "building")
