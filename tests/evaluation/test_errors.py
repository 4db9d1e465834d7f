# SPDX-License-Identifier: Apache-2.0
"""Lists and summaries of errors."""

from __future__ import annotations

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.errors import list_errors, order_errors, summarize_errors
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison


def test_errors_are_counted_by_kind_with_their_ranges(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    poses = [row["pose_id"] for row in simulated.rows[::3]]
    wrong = {f"{pose}-open": "semi_open" for pose in poses[3:6]} | {f"{poses[1]}-closed": "open"}
    results = load_results(make_comparison(simulated, {"dgcnn": wrong}))
    first, second = summarize_errors(results).to_dict("records")
    assert (first["method"], first["state"], first["predicted"]) == ("dgcnn", "closed", "open")
    assert (first["errors"], second["errors"]) == (1, 3)
    missed = [simulated.rows[simulated.index_of(name)] for name in list(wrong)[:3]]
    angles = sorted(float(row["opening_angle_deg"]) for row in missed)
    assert [second[f"opening_angle_deg_{end}"] for end in ("min", "median", "max")] == angles
    assert sum(int(part.split()[0]) for part in second["regions"].split(", ")) == 3


def test_listed_errors_carry_the_manifest(
    simulated: PreparedDataset, imported: PreparedDataset, make_comparison: MakeComparison
) -> None:
    row = simulated.rows[2]
    wrong = {"dgcnn": {row["sample_id"]: "semi_open"}}
    (error,) = list_errors(load_results(make_comparison(simulated, wrong))).to_dict("records")
    assert (error["method"], error["state"], error["predicted"]) == ("dgcnn", "open", "semi_open")
    assert (error["p_closed"], error["p_semi_open"]) == (0.15, 0.7)
    assert (error["region"], error["same_image_as"]) == (row["region"], "semi_open")
    assert error["opening_angle_deg"] == float(row["opening_angle_deg"])
    errors = list_errors(load_results(make_comparison(imported, {"dgcnn": {"open/3": "closed"}})))
    assert errors["sample_id"].tolist() == ["open/3"]
    assert errors[["region", "distance_m"]].isna().all(axis=None)


def test_decidable_errors_come_first_then_by_confidence(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    twin, first, second = (simulated.rows[k]["sample_id"] for k in (2, 6, 9))
    folder = make_comparison(simulated, {"dgcnn": {twin: "semi_open", first: "open", second: "open"}})
    for path in (folder / "runs" / "dgcnn").rglob("predictions.csv"):
        path.write_text(
            path.read_text().replace(
                f"{second},closed,open,0.15,0.15,0.7", f"{second},closed,open,0.05,0.05,0.9"
            )
        )
    assert order_errors(load_results(folder).errors)["sample_id"].tolist() == [second, first, twin]
