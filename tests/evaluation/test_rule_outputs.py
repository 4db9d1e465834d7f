# SPDX-License-Identifier: Apache-2.0
"""Outputs of rules besides the state, against scikit-learn and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import accuracy_score, precision_score, recall_score

from doorstate._files import read_csv, write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.rule_outputs import count_abstentions, score_angles, score_open_or_not
from tests.evaluation.conftest import MakeComparison


def test_open_or_not_is_an_output_of_a_rule_or_follows_from_the_state(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    opened = next(row["sample_id"] for row in simulated.rows if row["state"] == "open")
    closed = next(row["sample_id"] for row in simulated.rows if row["state"] == "closed")
    folder = make_comparison(simulated, {"pointnet": {opened: "semi_open", closed: "semi_open"}, "dgcnn": {}})
    assert score_open_or_not(load_results(folder)).empty
    true, predicted, undecided = [], [], 0
    for path in sorted((folder / "runs" / "dgcnn").rglob("predictions.csv")):
        rows = read_csv(path)
        for number, row in enumerate(rows):
            output = ("open", "not_open", "not_open", "")[number % 4]
            row |= {"predicted": "open" if output == "open" else "abstained", "open_or_not": output}
            row["reason"] = "" if output == "open" else "not open"
            true.append(row["state"] == "open")
            predicted.append(output == "open")
            undecided += output == ""
        write_csv(path, rows)
    results = load_results(folder)
    network, rule = score_open_or_not(results).to_dict("records")
    doors_open = sum(row["state"] == "open" for row in simulated.rows)
    assert network["recall"] == pytest.approx(1 - 1 / doors_open)
    assert (network["precision"], network["abstained"]) == (1, 0)
    assert network["accuracy"] == pytest.approx(1 - 1 / len(simulated.rows))  # closed and semi-open are one
    assert rule["recall"] == pytest.approx(recall_score(true, predicted))
    assert rule["precision"] == pytest.approx(precision_score(true, predicted))
    assert rule["abstained"] == undecided
    assert rule["accuracy"] < accuracy_score(true, predicted)  # an abstention is not "not open"
    assert count_abstentions(results).to_dict("records") == [
        {"method": "dgcnn", "reason": "not open", "samples": predicted.count(False)}
    ]


def test_angles_of_closed_doors_are_not_counted(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    folder = make_comparison(simulated, networks=["pointnet"])
    angles = {row["sample_id"]: float(row["opening_angle_deg"]) for row in simulated.rows}
    assert score_angles(load_results(folder)).empty
    for path in sorted((folder / "runs" / "pointnet").rglob("predictions.csv")):
        rows = read_csv(path)
        for row in rows:
            measured = row["state"] != "open"
            row["opening_angle_deg"] = str(angles[row["sample_id"]] + 4) if measured else ""
        write_csv(path, rows)
    scores = score_angles(load_results(folder)).set_index("region")
    assert scores.loc["all", ["doors", "measured"]].tolist() == [80, 40]
    np.testing.assert_allclose(scores["mean_deg"].dropna(), 4)
    np.testing.assert_allclose(scores.loc["all", ["median_deg", "p95_deg"]].astype(float), 4)
