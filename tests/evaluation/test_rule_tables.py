# SPDX-License-Identifier: Apache-2.0
"""What rules say in place of a state is counted as it was said."""

from __future__ import annotations

import csv

from sklearn.metrics import accuracy_score, precision_score, recall_score

from doorstate._files import read_csv, write_csv
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.results import load_results
from doorstate.evaluation.rule_tables import open_table

from .conftest import MakeComparison


def test_open_or_not_is_a_rules_word_or_follows_from_the_state(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    open_one = next(row["sample_id"] for row in simulated.rows if row["state"] == "open")
    shut_one = next(row["sample_id"] for row in simulated.rows if row["state"] == "closed")
    folder = make_comparison(
        simulated, wrong={"pointnet": {open_one: "semi_open", shut_one: "semi_open"}, "dgcnn": {}}
    )
    assert open_table(load_results(folder)).rows == ()
    true, said, silent = [], [], 0
    for path in sorted((folder / "runs" / "dgcnn").rglob("predictions.csv")):
        rows = read_csv(path)
        for number, row in enumerate(rows):
            told = ("open", "not_open", "not_open", "")[number % 4]
            row |= {"predicted": "open" if told == "open" else "abstained", "open_or_not": told}
            true.append(row["state"] == "open")
            said.append(told == "open")
            silent += told == ""
        write_csv(path, rows)
    network, rule = csv.DictReader(open_table(load_results(folder)).to_csv().splitlines())
    opened = sum(row["state"] == "open" for row in simulated.rows)
    assert float(network["recall of open"]) == round(1 - 1 / opened, 4)
    assert (network["precision of open"], network["no answer"]) == ("1.0000", "0")
    assert float(network["accuracy"]) == round(1 - 1 / len(simulated.rows), 4)  # closed and semi-open are one
    assert float(rule["recall of open"]) == round(recall_score(true, said), 4)
    assert float(rule["precision of open"]) == round(precision_score(true, said), 4)
    assert int(rule["no answer"]) == silent
    assert float(rule["accuracy"]) < round(accuracy_score(true, said), 4)  # silence is not "not open"
