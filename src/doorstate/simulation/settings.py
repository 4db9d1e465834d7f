# SPDX-License-Identifier: Apache-2.0
"""Settings of a simulated data set: a preset, a seed, and the number of poses."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, ValidationError

from doorstate._models import FrozenModel, Seed
from doorstate.errors import ConfigError, first_validation_error, unknown_name
from doorstate.simulation.frames import Frame
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.noise.sensors import find_sensor
from doorstate.simulation.presets import PRESETS, Preset
from doorstate.simulation.row import Row

MAX_SCENES = 1_000_000
RawKind = Literal["pcd", "depth", "image"]
RAW_KINDS: tuple[RawKind, ...] = ("pcd", "depth", "image")


class SimulationSettings(FrozenModel):
    """A preset with its seed and extent.

    `poses` counts poses of the half-ring, or scenes for presets of many scenes, which have one pose each; None is all
    of the half-ring, or 1000 scenes. `raw` lists the raw files to write beside the manifest.
    """

    preset: Preset
    seed: Seed
    poses: int | None = Field(default=None, ge=1, le=MAX_SCENES)
    raw: tuple[RawKind, ...] = ()
    sensor: str = "none"

    def indices(self) -> list[int]:
        """Return the numbers of the poses.

        Raises:
            ConfigError: more poses than the half-ring has.
        """
        return self.preset.indices(self.poses)

    def simulate(self, index: int) -> tuple[list[Row], list[Frame]]:
        """Return rows and frames of one pose."""
        return simulate_rows(self.preset, self.seed, index, self.sensor)


def settings_for(
    preset: str,
    seed: int,
    poses: int | None = None,
    scenes: int | None = None,
    raw: tuple[RawKind, ...] = (),
    sensor: str = "none",
) -> SimulationSettings:
    """Return the settings of a preset by its name.

    Args:
        preset: name in `PRESETS`.
        seed: seed of all random numbers.
        poses: number of poses, for presets of one scene.
        scenes: number of scenes, for presets of many scenes.
        raw: raw files to write.
        sensor: name for `find_sensor`.

    Raises:
        ConfigError: no such preset or sensor, a number the preset does not take, or one that is impossible.
    """
    find_sensor(sensor)
    if preset not in PRESETS:
        raise unknown_name("preset", preset, PRESETS, field="preset")
    chosen = PRESETS[preset]
    if chosen.has_many_scenes and poses is not None:
        raise ConfigError(
            f"preset {preset!r} has one pose per scene", field="poses", suggestions={"scenes": poses}
        )
    if not chosen.has_many_scenes and scenes is not None:
        raise ConfigError(f"preset {preset!r} has one scene", field="scenes", suggestions={"poses": scenes})
    count = scenes if chosen.has_many_scenes else poses
    if count is not None and not 1 <= count <= MAX_SCENES:
        raise ConfigError(
            f"{count} is out of range",
            field="scenes" if chosen.has_many_scenes else "poses",
            expected=f"1 to {MAX_SCENES}",
        )
    chosen.indices(count)
    try:
        return SimulationSettings(preset=chosen, seed=seed, poses=count, raw=raw, sensor=sensor)
    except ValidationError as error:
        raise ConfigError(first_validation_error(error)) from error
