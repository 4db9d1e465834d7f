# SPDX-License-Identifier: Apache-2.0
"""Measurement of how often weights answer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from paper.answers import count_answers, gazebo_frames, recorded_answers, simulated_doors, trained_presets
from paper.paths import PRETRAINED

from doorstate.inference.known import Known
from doorstate.inference.prediction import Prediction
from doorstate.inference.predictor import Predictor
from doorstate.networks.answers import AnswerCount, packaged_answers
from doorstate.types import DoorState, Points


class SaysOpen(Predictor):
    """Answers with open, but not for an empty cloud."""

    name = "open"

    def _predict(self, clouds: Sequence[Points], known: Known) -> list[Prediction]:
        return [Prediction(DoorState.OPEN if len(cloud) else None, 0, 0.0) for cloud in clouds]


def test_answers_and_right_ones_are_counted() -> None:
    cloud = np.ones((300, 3), np.float32)
    examples = [("open", cloud), ("closed", cloud), ("open", cloud[:0])]
    done: list[int] = []
    counted = count_answers(SaysOpen(), examples, 3, lambda number, total: done.append(number))
    assert counted == AnswerCount(frames=3, answered=2, right=1)
    assert (done, done[-1]) == (sorted(done), 3)


def test_clean_frames_hold_doors_in_all_states() -> None:
    states, clouds = zip(*gazebo_frames(), strict=True)
    assert Counter(states) == {"semi_open": 7, "open": 7, "closed": 6}
    assert {cloud.shape for cloud in clouds} == {(480, 640, 3)}


def test_presets_follow_from_the_card() -> None:
    text = "varied + cluttered + corridor + no-door, protocol by-scene, fold 0, and 20749 samples besides"
    assert trained_presets(text) == ["varied", "cluttered"]
    assert trained_presets("ogurob, protocol all, fold 0") == ["ogurob"]
    assert [state for state, _ in simulated_doors(["ogurob"], 3)] == ["closed", "semi_open", "open"]


def test_recorded_counts_are_those_of_the_published_weights() -> None:
    counted = recorded_answers(PRETRAINED / "pointnet2.safetensors")
    assert counted == packaged_answers()["pointnet2"].recorded
    assert recorded_answers(PRETRAINED / "ogurob-dgcnn.safetensors") is None
