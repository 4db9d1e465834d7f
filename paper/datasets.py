# SPDX-License-Identifier: Apache-2.0
"""Data sets of the experiments by name, and the commands that make them; `data/NAME-POINTS` is prepared.

A seed is a set of scenes: data sets of different sensors with the same seed show the same doors. Data sets that are
mixed have seeds of their own.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from doorstate.dataset.store import is_prepared

# Scenes of the default weights by preset and sensor: the tested data set has as many, `more-default` three times.
_DEFAULT_SCENES = {
    "building": {
        "xtion-matching": 500,
        "kinect-matching": 180,
        "d415": 150,
        "d435-matching": 350,
        "d455": 300,
        "oak-d": 80,
        "oak-d-pro": 120,
        "gemini-2": 100,
        "gemini-335": 150,
        "kinect-2": 150,
        "azure-kinect": 200,
        "azure-kinect-wide": 60,
        "none": 60,
    },
    "building-no-door": {
        "xtion-matching": 320,
        "kinect-matching": 120,
        "d415": 100,
        "d435-matching": 220,
        "d455": 190,
        "oak-d": 50,
        "oak-d-pro": 80,
        "gemini-2": 70,
        "gemini-335": 100,
        "kinect-2": 100,
        "azure-kinect": 130,
        "azure-kinect-wide": 40,
        "none": 40,
    },
    "varied": {"xtion": 400, "xtion-matching": 250, "d435-matching": 200},
    "cluttered": {"xtion-matching": 100, "kinect-2": 60},
    "corridor": {"xtion-matching": 80, "d455": 60},
    "two-doors": {"xtion-matching": 80, "d455": 60},
    "no-door": {"xtion": 200, "d435-matching": 100, "azure-kinect": 100},
}


def _default_parts(prefix: str, factor: int, first_seed: int) -> dict[str, str]:
    """Return the commands of all presets and sensors, each with a seed of its own."""
    parts = [
        (preset, sensor, scenes)
        for preset, sensors in _DEFAULT_SCENES.items()
        for sensor, scenes in sensors.items()
    ]
    return {
        f"{prefix}-{preset}-{sensor}": (
            f"--preset {preset} --scenes {factor * scenes} --seed {seed} --sensor {sensor}"
        )
        for seed, (preset, sensor, scenes) in enumerate(parts, first_seed)
    }


_DEFAULT, _MORE_DEFAULT = _default_parts("default", 1, 101), _default_parts("more-default", 3, 201)

SIMULATED = {
    "ogurob": "--preset ogurob",
    "ogurob-doorways": "--preset ogurob",
    # Training sets, alone and mixed; `varied` is `varied-xtion` without noise.
    "varied": "--preset varied --scenes 1200 --seed 11",
    "varied-xtion": "--preset varied --scenes 1200 --seed 11 --sensor xtion",
    "varied-d435": "--preset varied --scenes 900 --seed 12 --sensor d435",
    "varied-deepdoors2": "--preset varied --scenes 400 --seed 13 --sensor deepdoors2",
    "cluttered-kinect": "--preset cluttered --scenes 900 --seed 14 --sensor kinect",
    "no-door-xtion": "--preset no-door --scenes 700 --seed 15 --sensor xtion",
    "no-door-d435": "--preset no-door --scenes 600 --seed 16 --sensor d435",
    "no-door-kinect": "--preset no-door --scenes 600 --seed 17 --sensor kinect",
    "no-door-deepdoors2": "--preset no-door --scenes 300 --seed 18 --sensor deepdoors2",
    "varied-clean": "--preset varied --scenes 400 --seed 19",
    "no-door-clean": "--preset no-door --scenes 200 --seed 20",
    # Extra training sets: twice as many other scenes of the same presets and cameras, with a larger share of the Xtion.
    "more-varied-xtion": "--preset varied --scenes 2600 --seed 41 --sensor xtion",
    "more-varied-d435": "--preset varied --scenes 1300 --seed 42 --sensor d435",
    "more-varied-deepdoors2": "--preset varied --scenes 500 --seed 43 --sensor deepdoors2",
    "more-cluttered-kinect": "--preset cluttered --scenes 1400 --seed 44 --sensor kinect",
    "more-no-door-xtion": "--preset no-door --scenes 900 --seed 45 --sensor xtion",
    "more-no-door-d435": "--preset no-door --scenes 600 --seed 46 --sensor d435",
    "more-no-door-kinect": "--preset no-door --scenes 600 --seed 47 --sensor kinect",
    "more-no-door-deepdoors2": "--preset no-door --scenes 250 --seed 48 --sensor deepdoors2",
    "more-varied-clean": "--preset varied --scenes 300 --seed 49",
    "more-no-door-clean": "--preset no-door --scenes 100 --seed 50",
    # Training sets of doorways, mixed.
    "doorways-varied-xtion": "--preset varied --scenes 1000 --seed 61 --sensor xtion",
    "doorways-varied-d435": "--preset varied --scenes 500 --seed 62 --sensor d435",
    "doorways-varied-kinect": "--preset varied --scenes 250 --seed 63 --sensor kinect",
    "doorways-varied-clean": "--preset varied --scenes 200 --seed 64",
    "doorways-cluttered-xtion": "--preset cluttered --scenes 300 --seed 65 --sensor xtion",
    "doorways-cluttered-kinect": "--preset cluttered --scenes 250 --seed 66 --sensor kinect",
    "doorways-corridor-xtion": "--preset corridor --scenes 200 --seed 71 --sensor xtion",
    "doorways-corridor-d435": "--preset corridor --scenes 100 --seed 72 --sensor d435",
    "doorways-two-doors-xtion": "--preset two-doors --scenes 200 --seed 73 --sensor xtion",
    "doorways-two-doors-d435": "--preset two-doors --scenes 100 --seed 74 --sensor d435",
    "doorways-no-door-xtion": "--preset no-door --scenes 700 --seed 67 --sensor xtion",
    "doorways-no-door-d435": "--preset no-door --scenes 450 --seed 68 --sensor d435",
    "doorways-no-door-kinect": "--preset no-door --scenes 300 --seed 69 --sensor kinect",
    "doorways-no-door-clean": "--preset no-door --scenes 150 --seed 70",
    # As many again, most of them with doors.
    "more-doorways-varied-xtion": "--preset varied --scenes 1000 --seed 81 --sensor xtion",
    "more-doorways-varied-d435": "--preset varied --scenes 500 --seed 82 --sensor d435",
    "more-doorways-varied-kinect": "--preset varied --scenes 250 --seed 83 --sensor kinect",
    "more-doorways-cluttered-xtion": "--preset cluttered --scenes 400 --seed 84 --sensor xtion",
    "more-doorways-cluttered-d435": "--preset cluttered --scenes 300 --seed 85 --sensor d435",
    "more-doorways-cluttered-kinect": "--preset cluttered --scenes 250 --seed 86 --sensor kinect",
    "more-doorways-corridor-xtion": "--preset corridor --scenes 300 --seed 91 --sensor xtion",
    "more-doorways-corridor-d435": "--preset corridor --scenes 200 --seed 92 --sensor d435",
    "more-doorways-two-doors-xtion": "--preset two-doors --scenes 300 --seed 93 --sensor xtion",
    "more-doorways-two-doors-d435": "--preset two-doors --scenes 200 --seed 94 --sensor d435",
    "more-doorways-no-door-xtion": "--preset no-door --scenes 300 --seed 87 --sensor xtion",
    # The default weights: trained and tested, and trained in addition.
    **_DEFAULT,
    **_MORE_DEFAULT,
    # Test sets: the same doors for every sensor.
    **{
        f"test-{name}": f"--preset varied --scenes 100 --seed 21 --sensor {sensor}"
        for name, sensor in (
            *((sensor, sensor) for sensor in ("none", "xtion", "kinect", "d435", "deepdoors2")),
            *((f"{mm}mm", f"gaussian:{mm / 1000:g}") for mm in (5, 10, 20, 40)),
        )
    },
    "test-ogurob": "--preset ogurob --poses 200 --seed 31",
    "test-angles": "--preset varied-angles --scenes 200 --seed 22 --sensor xtion",
    "test-cluttered": "--preset cluttered --scenes 300 --seed 23 --sensor xtion",
    # The same frames cropped at their best doorway; no doorways of DeepDoors2's camera are trained on.
    "test-xtion-doorways": "--preset varied --scenes 100 --seed 21 --sensor xtion",
    "test-deepdoors2-doorways": "--preset varied --scenes 100 --seed 21 --sensor deepdoors2",
    "test-cluttered-doorways": "--preset cluttered --scenes 300 --seed 23 --sensor xtion",
}
# Every camera sees doors and bare walls: the noise of a camera must not tell them apart.
_MIXED = (
    "varied-xtion",
    "varied-d435",
    "varied-deepdoors2",
    "cluttered-kinect",
    "no-door-xtion",
    "no-door-d435",
    "no-door-kinect",
    "no-door-deepdoors2",
    "varied-clean",
    "no-door-clean",
)
_DOORWAYS = tuple(name for name in SIMULATED if name.startswith("doorways-"))
_MORE_DOORWAYS = tuple(name for name in SIMULATED if name.startswith("more-doorways-"))
JOINED = {
    "mixture": _MIXED,
    "more-mixture": tuple(f"more-{part}" for part in _MIXED),
    "doorways-train": _DOORWAYS,
    "more-doorways": _MORE_DOORWAYS,
    "default": tuple(_DEFAULT),
    "more-default": tuple(_MORE_DEFAULT),
}
# The D435 reaches 10 m, all others 5 m or less. Doors are within 3.5 m; without a limit, farthest-point sampling would
# spend most points on the next room behind an open door. Clouds are thinned as a predictor thins them.
LIMITS = "--thin --max-depth-m 5"
# The published clouds were made before outliers were removed.
OUTLIERS = "--keep-outliers"


class Command(NamedTuple):
    """Arguments of `doorstate` and the prepared data set that they make."""

    arguments: str
    prepared: Path


def dataset_commands(prepared: Path) -> Iterator[Command]:
    """Yield the commands that make a data set, in order; a command whose work is done costs nothing.

    Args:
        prepared: folder `data/NAME-POINTS`.

    Raises:
        KeyError: there is no such data set.
    """
    name, _, points = prepared.name.rpartition("-")
    if name not in JOINED:
        output = f"--prepared data/{name}-{points} --points {points} {_preparation(name)}"
        yield Command(f"simulate {SIMULATED[name]} --out data/{name} {output}", prepared)
    elif not is_prepared(prepared):
        parts = [prepared.with_name(f"{part}-{points}") for part in JOINED[name]]
        for part in parts:
            yield from dataset_commands(part)
        joined = " ".join(f"data/{part.name}" for part in parts)
        yield Command(f"join {joined} --out data/{name}-{points}", prepared)


def _preparation(name: str) -> str:
    """Return the options of the prepared clouds of a simulation."""
    if name in (*_DOORWAYS, *_MORE_DOORWAYS, *_DEFAULT, *_MORE_DEFAULT):
        return "--input doorway --add-missed"
    if name.endswith("-doorways"):  # one answer a frame
        return "--input doorway --crops best"
    return OUTLIERS if name.endswith("ogurob") else f"{LIMITS} {OUTLIERS}"
