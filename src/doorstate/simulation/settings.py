# SPDX-License-Identifier: Apache-2.0
"""What a simulated data set is made of: a preset, a seed, and how much of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from pydantic import Field

from doorstate._models import FrozenModel
from doorstate.errors import ConfigError
from doorstate.simulation.frames import Frame
from doorstate.simulation.generate import PRESETS, Preset, pose_indices, simulate_pose
from doorstate.simulation.manifest import Row
from doorstate.simulation.noise.models import find_sensor
from doorstate.simulation.scene_rows import SCENE_PRESETS, ScenePreset, simulate_scene

RawKind = Literal["pcd", "depth", "image"]
RAW_KINDS: tuple[RawKind, ...] = ("pcd", "depth", "image")
DEFAULT_SCENES = 1000


class SimulationSettings(FrozenModel):
    """One door, seen from the half-ring of poses or some of it."""

    preset: Preset
    seed: int
    poses: int | None
    raw: tuple[RawKind, ...] = ()
    sensor: str = "none"

    def indices(self) -> list[int]:
        """Numbers of the poses."""
        return pose_indices(self.poses)

    def simulate(self, index: int) -> tuple[Sequence[Row], list[Frame]]:
        """Rows and frames of one pose."""
        return simulate_pose(self.preset, self.seed, index, self.sensor)


class SceneSettings(FrozenModel):
    """Many scenes, each seen from one pose."""

    preset: ScenePreset
    seed: int
    scenes: int = Field(default=DEFAULT_SCENES, ge=1)
    raw: tuple[RawKind, ...] = ()
    sensor: str = "none"

    def indices(self) -> list[int]:
        """Numbers of the scenes."""
        return list(range(self.scenes))

    def simulate(self, index: int) -> tuple[Sequence[Row], list[Frame]]:
        """Rows and frames of one scene."""
        return simulate_scene(self.preset, self.seed, index, self.sensor)


Settings = SimulationSettings | SceneSettings


def settings_for(
    preset: str,
    seed: int,
    poses: int | None,
    scenes: int | None,
    raw: tuple[RawKind, ...] = (),
    sensor: str = "none",
) -> Settings:
    """Settings of a preset by its name; poses belong to presets of one door, scenes to the others.

    Raises:
        ConfigError: no such preset or sensor, or the preset has no such number.
    """
    find_sensor(sensor)
    if preset in PRESETS:
        if scenes is not None:
            raise ConfigError(f"--scenes {scenes}: preset {preset!r} has one scene; choose --poses")
        return SimulationSettings(preset=PRESETS[preset], seed=seed, poses=poses, raw=raw, sensor=sensor)
    for name, scene_preset in SCENE_PRESETS.items():
        if name == preset:
            if poses is not None:
                raise ConfigError(f"--poses {poses}: preset {preset!r} has one pose a scene; choose --scenes")
            count = DEFAULT_SCENES if scenes is None else scenes
            return SceneSettings(preset=scene_preset, seed=seed, scenes=count, raw=raw, sensor=sensor)
    raise ConfigError(f"no preset {preset!r}: choose one of {', '.join([*PRESETS, *SCENE_PRESETS])}")
