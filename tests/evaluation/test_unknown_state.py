# SPDX-License-Identifier: Apache-2.0
"""Doors of unknown state are doors to find, and neither right nor wrong in their state."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from doorstate._files import write_csv
from doorstate.dataset.splits import read_splits
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.calibration import calibrate
from doorstate.evaluation.frame_scores import score_frames
from doorstate.evaluation.heads import score_four_labels, score_presence
from doorstate.evaluation.metrics import confusion, macro_f1
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.results import Results
from doorstate.evaluation.strata import count_samples, score_strata
from doorstate.evaluation.tables import build_tables
from doorstate.types import NO_DOOR, STATES, UNKNOWN_STATE
from tests.evaluation.conftest import MakeComparison

FOUND = 15  # of 20 doors of unknown state


@pytest.fixture
def comparison(with_unknown_states: PreparedDataset, make_comparison: MakeComparison) -> Path:
    """Write a network that has all states right, finds all doors with one, and takes no wall for a door."""
    folder = make_comparison(with_unknown_states, networks=("pointnet",))
    for fold, roles in enumerate(read_splits(folder / "splits.csv")):
        outputs = []
        for sample in (name for name, role in roles.items() if role == "test"):
            state, number = sample.split("/")
            is_found = state in STATES or (state == UNKNOWN_STATE and int(number) < FOUND)
            outputs.append({"sample_id": sample, "p_door": "0.9" if is_found else "0.1"})
        write_csv(folder / "runs" / "pointnet" / f"fold{fold}" / "head_outputs.csv", outputs)
    return folder


@pytest.fixture
def results(comparison: Path) -> Results:
    return load_results(comparison)


def test_scores_of_states_leave_them_out(results: Results) -> None:
    assert set(results.tested["state"]) == set(STATES)
    assert len(results.tested) == 60
    assert confusion(results.joined).sum() == 60
    assert macro_f1(results.tested) == 1
    assert results.errors.empty
    assert calibrate(results, "pointnet") is None  # without validation predictions, and without an error


def test_they_are_doors_to_find(results: Results) -> None:
    presence = score_presence(results)
    doors, empty = presence[presence["door"]], presence[~presence["door"]]
    assert (doors["samples"].sum(), doors["predicted_door"].sum()) == (80, 60 + FOUND)
    assert (empty["samples"].sum(), empty["predicted_door"].sum()) == (20, 0)


def test_four_labels_leave_them_out(results: Results) -> None:
    (row,) = score_four_labels(results).to_dict("records")
    assert (row["samples"], row["accuracy"]) == (80, 1)
    assert row[NO_DOOR] == 1


def test_they_have_a_line_of_their_own_in_the_strata(results: Results, simulated: PreparedDataset) -> None:
    counts = count_samples(results.manifest).set_index(["state", "region"])["all"]
    assert counts[UNKNOWN_STATE, "all"] == 20
    assert counts["all", "all"] == 100
    assert score_strata(results, "open")["state_samples"].max() == 20
    without = count_samples(pd.DataFrame(simulated.rows))
    assert UNKNOWN_STATE not in set(without["state"])


def test_every_table_can_be_built(results: Results) -> None:
    tables = build_tables(results)
    assert len(tables["misclassified"].rows) == 0


def test_recorded_frames_of_unknown_state_are_no_errors() -> None:
    rows = pd.DataFrame({"method": "a", "state": ["open", "unknown"], "predicted": ["open", "closed"]})
    rows = rows.assign(**{f"p_{state}": 0.5 for state in STATES}, correct=[True, True])
    scores = score_frames(rows, pd.Series(["1", "2"]), {})
    assert (scores.frames, scores.scores.iloc[0]["accuracy"]) == (1, 1)
