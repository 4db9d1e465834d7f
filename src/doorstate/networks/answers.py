# SPDX-License-Identifier: Apache-2.0
"""Share of frames that packaged weights answer, and answer rightly; `python -m paper answers` measures it."""

from __future__ import annotations

import json
from functools import cache

from doorstate._models import FrozenModel
from doorstate.networks.packaged import PRETRAINED, packaged_networks

ANSWERS_FILE = "answers.json"
FEWEST_ANSWERS = 0.5  # share of clean frames that weights must answer to be offered


class AnswerCount(FrozenModel):
    """Frames with a door, those that were given a state, and those that were given the right one."""

    frames: int
    answered: int
    right: int

    def __str__(self) -> str:
        return f"{self.answered} of {self.frames}, {self.right} right"


class Answers(FrozenModel):
    """Counts of one weights file."""

    clean: AnswerCount  # rendered by Gazebo, without noise
    simulated: AnswerCount  # doors of the presets that the weights were trained for, not seen in training
    recorded: AnswerCount | None = None  # published frames of real doors (docs/real.md)

    @property
    def are_frequent(self) -> bool:
        """True if the weights answer often enough to be offered."""
        return self.clean.answered >= FEWEST_ANSWERS * self.clean.frames


@cache
def packaged_answers() -> dict[str, Answers]:
    """Return the counts of the packaged weights by name."""
    text = (PRETRAINED / ANSWERS_FILE).read_text(encoding="utf-8")
    return {name: Answers.model_validate(counts) for name, counts in json.loads(text).items()}


def offered_networks() -> list[str]:
    """Return the names of the packaged weights that answer often enough, and of those not measured."""
    answers = packaged_answers()
    return [name for name in packaged_networks() if name not in answers or answers[name].are_frequent]
