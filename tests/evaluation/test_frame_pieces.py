# SPDX-License-Identifier: Apache-2.0
"""Frames that several processes evaluate: the same results in the same order."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from doorstate._jobs import ProcessEngine
from doorstate.dataset.labelled import LabelledFrame
from doorstate.evaluation import frame_pieces
from doorstate.evaluation.frame_pieces import PredictorArguments, evaluate_frames_in_pieces
from doorstate.evaluation.frames import evaluate_frames
from doorstate.io.readers import read_posed_cloud
from doorstate.simulation.frames import Frame
from doorstate.types import STATES


def test_pieces_give_the_results_of_one_process(
    frames: list[Frame], weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    labelled = []
    for number, (state, frame) in enumerate(zip((*STATES, *STATES), (*frames, *frames), strict=True)):
        path = tmp_path / f"{number}.npy"
        if number != 4:  # which cannot be read
            np.save(path, frame.points)
        labelled.append(
            LabelledFrame(path.name, state, {"door": "oak"}, tmp_path, partial(read_posed_cloud, path))
        )
    methods = PredictorArguments({"net": {"name_or_path": weights}, "plane_state": {"rule": "plane_state"}})
    monkeypatch.setattr(frame_pieces, "_FRAMES_PER_PIECE", 2)
    steps: list[tuple[int, int]] = []
    scratch = tmp_path / "out"
    scratch.mkdir()
    pieces = evaluate_frames_in_pieces(
        methods, labelled, ProcessEngine(2), scratch, lambda *step: steps.append(step)
    )
    whole = evaluate_frames(methods.load(), labelled)
    assert steps[-1] == (3, 3)
    assert not list(scratch.iterdir())
    assert [frame.file for frame in pieces.frames] == [frame.file for frame in whole.frames]
    assert [(frame.file, reason) for frame, reason in pieces.unreadable] == [
        (frame.file, reason) for frame, reason in whole.unreadable
    ]
    assert pieces.predictions.equals(whole.predictions)
    assert pieces.joined.equals(whole.joined)
