# SPDX-License-Identifier: Apache-2.0
"""Simulated clouds that adaptation mixes in and tests on, made once in a folder that all adaptations share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from doorstate import __version__
from doorstate._jobs import Progress, WorkersOrEngine, no_progress
from doorstate.clouds.preparation import CloudSpec
from doorstate.dataset.crops import Crops
from doorstate.dataset.preparation import Preparation
from doorstate.dataset.simulated import simulate_prepared
from doorstate.dataset.store import PreparedDataset, is_prepared, open_dataset
from doorstate.networks.card import WeightsCard
from doorstate.simulation.presets import PRESETS
from doorstate.simulation.settings import settings_for


class SimulatedPart(NamedTuple):
    """Scenes of one preset seen by one sensor."""

    preset: str
    sensor: str
    scenes: int
    seed: int


# Several sensors, because nobody knows which one the place has; as many scenes as can be made in a minute or two.
DOORWAYS = (
    (
        SimulatedPart("building", "xtion-matching", 30, 7001),
        SimulatedPart("building", "d435-matching", 30, 7002),
        SimulatedPart("building-no-door", "xtion-matching", 20, 7003),
        SimulatedPart("varied", "xtion", 30, 7004),
    ),
    (
        SimulatedPart("building", "xtion-matching", 40, 7011),
        SimulatedPart("building", "d435-matching", 40, 7012),
        SimulatedPart("varied", "xtion", 40, 7014),
    ),
)
# The data of the weights for whole clouds; its test shows other poses.
WHOLE = ((SimulatedPart("ogurob", "none", 100, 7001),), (SimulatedPart("ogurob", "none", 99, 7011),))


class Simulated(NamedTuple):
    """Simulated clouds to train on, and others to test that nothing is forgotten."""

    train: list[PreparedDataset]
    test: list[PreparedDataset]


Parts = tuple[Sequence[SimulatedPart], Sequence[SimulatedPart]]
"""Parts to train on, and parts to test on."""


def simulate_for(
    card: WeightsCard,
    cache: Path,
    workers: WorkersOrEngine = None,
    progress: Progress = no_progress,
    parts: Parts | None = None,
) -> Simulated:
    """Make the simulated clouds for weights, or go on making them.

    Args:
        card: card of the weights.
        cache: folder; clouds that are in it are not made again.
        workers: processes, None is one per processor; or an engine.
        progress: called with scenes done and scenes in all.
        parts: parts to simulate; None: those for the input of the weights.
    """
    train, test = parts or (DOORWAYS if card.input == "doorway" else WHOLE)
    total, done = sum(part.scenes for part in (*train, *test)), 0
    made: list[PreparedDataset] = []
    for part in (*train, *test):

        def update(pieces: int, of: int, before: int = done, scenes: int = part.scenes) -> None:
            progress(before + scenes * pieces // max(1, of), total)

        made.append(_simulate(part, card, cache, workers, update))
        done += part.scenes
    return Simulated(made[: len(train)], made[len(train) :])


def _simulate(
    part: SimulatedPart, card: WeightsCard, cache: Path, workers: WorkersOrEngine, progress: Progress
) -> PreparedDataset:
    of_scenes = PRESETS[part.preset].has_many_scenes
    scenes, poses = (part.scenes, None) if of_scenes else (None, part.scenes)
    settings = settings_for(part.preset, part.seed, poses=poses, scenes=scenes, sensor=part.sensor)
    spec = CloudSpec(
        num_points=card.points_in_use, max_depth_m=card.max_depth_m, remove_outliers=card.remove_outliers
    )
    crops = Crops(add_missed=True) if card.input == "doorway" else None
    folder = cache / f"simulated-{__version__}" / f"{part.preset}-{part.sensor}-{part.scenes}-{part.seed}"
    name = f"{card.input}-{spec.num_points}" + (f"-{spec.max_depth_m:g}m" if spec.max_depth_m else "")
    name += "" if spec.remove_outliers else "-with-outliers"
    if is_prepared(folder / name):  # wherever it was made
        return open_dataset(folder / name)
    preparation = Preparation(folder / "scenes", spec, crops=crops)
    return simulate_prepared(settings, preparation, folder / name, workers, progress).dataset
