# SPDX-License-Identifier: Apache-2.0
"""Counts of answers of the packaged weights."""

from __future__ import annotations

import pytest

from doorstate.inference.predictor import DEFAULT_NETWORK
from doorstate.networks import MULTI_VIEW, NETWORKS, answers, create_network
from doorstate.networks.answers import AnswerCount, Answers, offered_networks, packaged_answers
from doorstate.networks.packaged import packaged_networks
from doorstate.networks.parameters import NUM_PARAMETERS


def test_all_packaged_weights_are_measured() -> None:
    assert sorted(packaged_answers()) == packaged_networks()
    for counts in packaged_answers().values():
        for count in (counts.clean, counts.simulated, counts.recorded):
            assert count is None or 0 <= count.right <= count.answered <= count.frames
        assert (counts.clean.frames, counts.simulated.frames) == (20, 300)


def test_the_default_is_offered() -> None:
    assert DEFAULT_NETWORK in offered_networks()


def test_weights_that_hardly_answer_are_not_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    def counts(answered: int) -> Answers:
        count = AnswerCount(frames=20, answered=answered, right=answered)
        return Answers(clean=count, simulated=count)

    measured = {"pointnet2": counts(10), "ogurob-pointnet": counts(9)}
    monkeypatch.setattr(answers, "packaged_answers", lambda: measured)
    assert set(packaged_networks()) - set(offered_networks()) == {"ogurob-pointnet"}


def test_numbers_of_parameters() -> None:
    assert list(NUM_PARAMETERS) == [*NETWORKS, *MULTI_VIEW]
    for name, expected in NUM_PARAMETERS.items():
        assert sum(p.numel() for p in create_network(name).parameters()) == expected
