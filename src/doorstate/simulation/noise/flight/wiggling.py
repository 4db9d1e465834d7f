# SPDX-License-Identifier: Apache-2.0
"""Wiggling: an error that repeats along the distance, because the modulated light is no pure sine."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.simulation.noise.windows import Image


class Wiggling(FrozenModel):
    """Largest error, and the distance after which it repeats: a quarter of the unambiguous distance."""

    amplitude_m: float = Field(ge=0)
    period_m: float = Field(gt=0)


def wiggle(distance_m: Image, wiggling: Wiggling, rng: np.random.Generator) -> Image:
    """Return the error in metres for each distance (H, W); its phase, that of one device, is drawn."""
    phase = distance_m * np.float32(1 / wiggling.period_m)
    phase += np.float32(rng.random())
    phase -= np.floor(phase)
    # Two parabolas are a sine within 6 %, and the same on all processors.
    phase -= np.float32(0.5)
    error: Image = np.float32(0.5) - np.abs(phase)
    error *= phase
    error *= np.float32(16 * wiggling.amplitude_m)
    return error
