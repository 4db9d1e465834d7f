# SPDX-License-Identifier: Apache-2.0
"""Values of the computed pages."""

from __future__ import annotations

import pytest
from paper.pages import generalization, real, related, results
from paper.pages.render import PAGES
from paper.paths import DOCS
from paper.published import comparison, study


def test_rules_are_compared_on_the_samples_of_the_networks() -> None:
    content = related.content()
    assert content["samples"] == 4059
    assert (content["rule"].name, content["rule"]["errors"], content["rule"]["abstained"]) == (
        "wall_leaf_angle",
        51,
        37,
    )
    assert content["network"].name == "pointnet2"
    assert content["ahead"] == ["PointNet", "DGCNN", "MVCNN"]


def test_statements_of_the_paper() -> None:
    content = results.content()
    assert content["hits"] == (1350, 1353)
    assert content["errors"] == {"paper": (146, 81, 49), "by-pose": (2235, 567, 511)}
    assert content["lowest_recall"]["semi_open"] == (["dgcnn"], pytest.approx(0.9793, abs=5e-5))
    assert content["lowest"] == pytest.approx(0.9793, abs=5e-5)


def test_core_hours_are_summed_over_trained_runs() -> None:
    table = results.cost_table([comparison(name) for name in results.EXPERIMENTS])
    assert table.rows[-1] == ("all", "65", "38.9")


def test_scores_by_number_of_points() -> None:
    table = results.points_table(study("resolution"))
    by_network = {row[0]: row[1:] for row in table.rows}
    assert by_network["PointNet++"] == (
        "0.910 / 0.913",
        "0.913 / 0.908",
        "0.913 / 0.908",
        "0.913 / 0.907",
        "0.913",
        "25.8",
        "61.5",
    )


def test_transfer_from_the_mixture() -> None:
    table = generalization.transfer_table("transfer")
    mixture = next(row for row in table.rows if row[0] == "mixture")
    assert mixture[1:] == (
        *("0.997", "0.930", "0.940", "0.934", "0.927", "0.881"),
        *("0.906", "0.920", "0.943", "0.919", "0.812", "0.803"),
    )


def test_recorded_frames() -> None:
    frames = real.summarize_frames(real.read_frames()).set_index("method")
    assert frames["frames"].unique().tolist() == [26]
    assert (frames["correct"] + frames["wrong"] + frames["abstained"] == 26).all()
    assert frames.loc["always closed", "correct"] == 23
    assert frames.loc["pointnet2", "wrong"] <= 2


def test_the_readme_has_the_scores_on_recorded_frames() -> None:
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    rows = real.summary_table(real.summarize_frames(real.read_frames())).to_markdown().splitlines()
    missing = [row for row in rows if row.startswith("| ") and row not in readme]
    assert missing == []


# The reference of commands has a line for each option.
@pytest.mark.parametrize("name", sorted({*PAGES, "limits"} - {"commands"}))
def test_a_page_is_short(name: str) -> None:
    most = 250 if name == "commands" else 165  # a line for each option
    assert len((DOCS / f"{name}.md").read_text(encoding="utf-8").splitlines()) <= most
