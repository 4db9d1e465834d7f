# SPDX-License-Identifier: Apache-2.0
"""Parts of all optical sensors: the view, angles of incidence, surfaces, and the light of the sensor's own emitter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.io.camera import Intrinsics
from doorstate.simulation.camera import CameraPose
from doorstate.simulation.noise.conditions import INDOORS, Conditions
from doorstate.simulation.noise.streams import stage_rng
from doorstate.simulation.render import NO_BOX, Render, against_normal
from doorstate.simulation.scene.box import Box
from doorstate.simulation.z_buffer import ray_slopes
from doorstate.types import Part

Image = NDArray[np.float32]
WHITE = 0.8  # albedo of a white wall, at which reaches and noise are given
_COSINE_STEPS = 2**14
# Rounded to 2^-14 radians, because processors differ in the last digits of an arc cosine.
_ANGLES = np.array(
    [round(math.acos(step / _COSINE_STEPS) * 2**14) / 2**14 for step in range(_COSINE_STEPS + 1)], np.float32
)

# Assumed ranges of the albedo in infrared, and of the texture: 1 is what a matcher needs at least.
_ALBEDO = {
    Part.WALL: (0.6, 0.9),
    Part.CEILING: (0.6, 0.9),
    Part.FLOOR: (0.2, 0.6),
    Part.FRAME: (0.3, 0.9),
    Part.LEAF: (0.2, 0.9),
}
_TEXTURE = {
    Part.WALL: (0.0, 1.6),
    Part.CEILING: (0.0, 1.2),
    Part.FLOOR: (0.6, 3.0),
    Part.FRAME: (0.0, 1.6),
    Part.LEAF: (0.0, 2.2),
}
_OTHER_ALBEDO, _OTHER_TEXTURE = (0.1, 0.9), (0.5, 4.0)
_MATERIAL_ALBEDO = {"dark": (0.03, 0.08), "gloss": (0.1, 0.5)}


class Emitter(FrozenModel):
    """Light source of the sensor: an infrared pattern, or modulated light."""

    reach_m: float = Field(gt=0)  # at which a white wall returns just enough light
    sun_reach_m: float = Field(gt=0)  # the same in direct sunlight
    off_share: float = Field(default=0.0, ge=0, le=1)  # of the scenes


class View(NamedTuple):
    """A rendering, how it was made, and under which conditions a sensor measures it."""

    rendered: Render  # result of `render_behind_glass`, or after earlier stages
    boxes: Sequence[Box]
    pose: CameraPose
    intrinsics: Intrinsics
    seed: int
    conditions: Conditions = INDOORS

    def rng(self, stage: str) -> np.random.Generator:
        """Return the random stream of a stage."""
        return stage_rng(self.seed, stage)


def ray_lengths(intrinsics: Intrinsics) -> Image:
    """Return the distance (H, W) of the points at unit depth from the camera."""
    left, up = (slope.astype(np.float32) for slope in ray_slopes(intrinsics))
    squares = left * left + (up * up + np.float32(1))
    return np.sqrt(squares, out=squares)


def cosines(view: View, ray_length: Image) -> Image:
    """Return the cosine of the angle of incidence (H, W), 1 where nothing is hit; that of `render.incidence`."""
    cosine: Image = against_normal(view.rendered, view.boxes, view.pose, view.intrinsics, np.float32)
    cosine /= ray_length
    np.copyto(cosine, np.float32(1), where=view.rendered.box == NO_BOX)
    return np.minimum(cosine, np.float32(1), out=cosine)


def angles(cosine: Image) -> Image:
    """Return the angle of incidence (H, W) in radians from a table: exact to 0.01 degrees beyond 20, to 0.5 before."""
    entry = cosine * np.float32(_COSINE_STEPS)
    entry += np.float32(0.5)
    return _ANGLES.take(entry.astype(np.int32))


class Surfaces(NamedTuple):
    """Albedo and texture of what each pixel sees."""

    albedo: Image  # (H, W)
    texture: Image  # (H, W), 1 is what a matcher needs at least


def draw_surfaces(view: View) -> Surfaces:
    """Draw albedo and texture of each box; nothing has 0 of both."""
    drawn = view.rng("surfaces").random((2, len(view.boxes) + 1))
    tables = np.zeros((2, len(view.boxes) + 1), np.float32)
    for number, box in enumerate(view.boxes):
        usual = _ALBEDO.get(box.part, _OTHER_ALBEDO)
        ranges = (_MATERIAL_ALBEDO.get(box.material, usual), _TEXTURE.get(box.part, _OTHER_TEXTURE))
        for table, share, (low, high) in zip(tables, drawn[:, number].tolist(), ranges, strict=True):
            table[number] = low + share * (high - low)
    # NO_BOX is -1 and so indexes the last entry.
    assert NO_BOX == -1
    return Surfaces(tables[0].take(view.rendered.box), tables[1].take(view.rendered.box))


def received(
    emitter: Emitter, albedo: Image, cosine: Image, distance_m: Image, conditions: Conditions
) -> Image:
    """Return the emitter's light that comes back, relative to what the sensor needs; 0 if the emitter is off.

    It falls with the square of distance and with incidence. Sunlight lowers it, so that in direct sunlight a white wall
    is measured up to `sun_reach_m`.
    """
    if not conditions.emitter_on:
        return np.zeros(albedo.shape, np.float32)
    scale = emitter.reach_m**2 / WHITE / dimming(emitter, conditions)
    light = albedo * cosine
    light *= np.float32(scale)
    square = distance_m * distance_m
    light /= square
    return light


def dimming(emitter: Emitter, conditions: Conditions) -> float:
    """Return the factor by which sunlight lowers the emitter's light relative to what the sensor needs."""
    return 1 + conditions.sun_share * ((emitter.reach_m / emitter.sun_reach_m) ** 2 - 1)
