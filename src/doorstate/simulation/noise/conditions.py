# SPDX-License-Identifier: Apache-2.0
"""Conditions of a scene that decide how well a sensor measures it: sunlight, and an emitter that is off."""

from __future__ import annotations

from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.noise.streams import sample_seed, stage_rng

_DAYLIGHT_SHARE = 0.4  # assumed: scenes with daylight
_DARKEST, _BRIGHTEST = 1e-3, 0.3  # assumed: a lit room, sunlight through a window


class Conditions(FrozenModel):
    """Light on a scene; the defaults are a room without daylight, measured with the emitter on."""

    sun_share: float = Field(default=0.0, ge=0, le=1)  # ambient light relative to direct sunlight
    emitter_on: bool = True


INDOORS = Conditions()


def draw_conditions(seed: int, scene: str, emitter_off_share: float) -> Conditions:
    """Draw the conditions of a scene: the same for all its samples, and for all sensors up to the emitter.

    Args:
        seed: seed of the data set.
        scene: name of the scene or pose.
        emitter_off_share: probability that the emitter is off.
    """
    rng = stage_rng(sample_seed(seed, scene), "conditions")
    daylight, brightness, emitter = rng.random(3).tolist()
    sun_share = _DARKEST * (_BRIGHTEST / _DARKEST) ** brightness if daylight < _DAYLIGHT_SHARE else 0.0
    # Rounded, because processors may differ in the last digit of a power.
    return Conditions(sun_share=round(sun_share, 6), emitter_on=emitter >= emitter_off_share)
