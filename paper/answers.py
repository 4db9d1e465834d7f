# SPDX-License-Identifier: Apache-2.0
"""Share of clean, simulated and recorded frames that packaged weights answer, and answer rightly."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from doorstate._documents import read_json
from doorstate._files import write_text
from doorstate._jobs import Progress
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.networks.answers import ANSWERS_FILE, AnswerCount
from doorstate.simulation.frames import level, replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import STATES, Points

from . import paths
from .pages.real import read_frames

SEED = 1_000_003  # of no data set
OTHERS = ("no-door", "corridor", "two-doors")  # presets with no door, or several
GAZEBO = paths.REPOSITORY / "tests" / "fixtures" / "gazebo"
Example = tuple[str, Points]
"""True state and cloud."""


def write_answers(names: Iterable[str], count: int, progress: Progress) -> Path:
    """Measure weights and write the counts beside them; other weights in the file stay.

    Args:
        names: packaged weights.
        count: number of simulated doors.
        progress: called after each cloud.
    """
    path = paths.PRETRAINED / ANSWERS_FILE
    counts: dict[str, Any] = read_json(path) if path.is_file() else {}
    for name in names:
        predictor = NetworkPredictor.from_weights(name)
        presets = trained_presets(predictor.card.trained_on)
        measured = {
            "clean": count_answers(predictor, gazebo_frames(), 20, progress),
            "simulated": count_answers(predictor, simulated_doors(presets, count), count, progress),
            "recorded": recorded_answers(paths.PRETRAINED / f"{name}.safetensors"),
        }
        counts[name] = {key: value.model_dump() for key, value in measured.items() if value is not None}
    write_text(path, json.dumps(dict(sorted(counts.items())), indent=2) + "\n")
    return path


def count_answers(
    predictor: Predictor, examples: Iterable[Example], total: int, progress: Progress
) -> AnswerCount:
    """Count answers and right ones among about `total` examples."""
    frames = answered = right = 0
    for frames, (state, cloud) in enumerate(examples, 1):
        predicted = predictor(cloud).state
        answered += predicted is not None
        right += predicted == state
        progress(min(frames, total - 1), total)
    progress(total, total)
    return AnswerCount(frames=frames, answered=answered, right=right)


def gazebo_frames() -> Iterator[Example]:
    """Yield the twenty frames without noise that Gazebo rendered."""
    with np.load(GAZEBO / "depth.npz") as stored:
        depth_m = stored["depth"]
    for image, frame in zip(depth_m, _gazebo_scenes(), strict=True):
        camera = frame["intrinsics"]
        intrinsics = Intrinsics(
            camera["width"], camera["height"], camera["f"], camera["f"], camera["cx"], camera["cy"]
        )
        yield frame["state"], level(depth_to_points(image, intrinsics), frame["camera"]["pitch"])


def gazebo_heights_m() -> list[float]:
    """Return the heights of the cameras of these frames above the floor."""
    return [frame["camera"]["z"] for frame in _gazebo_scenes()]


def _gazebo_scenes() -> list[dict[str, Any]]:
    scenes: list[dict[str, Any]] = json.loads((GAZEBO / "scenes.json").read_text(encoding="utf-8"))
    return scenes


def trained_presets(trained_on: str) -> list[str]:
    """Return the presets with one door among the data sets of a card, such as `varied + cluttered + no-door, ...`."""
    names = [name.strip() for name in trained_on.partition(",")[0].split("+")]
    return [name for name in names if name in PRESETS and name not in OTHERS]


def simulated_doors(presets: list[str], count: int) -> Iterator[Example]:
    """Yield doors in all states that no weights were trained on, an equal number of each preset."""
    for preset in presets:
        poses = PRESETS[preset].indices(-(-count // len(presets) // len(STATES)))
        for pose in poses:
            for row in draw_rows(PRESETS[preset], SEED, pose):
                yield row.state, replay(row).points


def recorded_answers(weights: Path) -> AnswerCount | None:
    """Return the published counts on recorded frames with a door; None if these weights were not tested on them."""
    tested = read_json(paths.RESULTS / "real" / "experiment.json")
    if hashlib.sha256(weights.read_bytes()).hexdigest() != tested["sha256"]:
        return None
    rows = read_frames()
    rows = rows[(rows["method"] == tested["network"]) & rows["state"].isin(STATES)]
    return AnswerCount(
        frames=len(rows), answered=int(rows["predicted"].isin(STATES).sum()), right=int(rows["correct"].sum())
    )
