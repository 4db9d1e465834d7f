# SPDX-License-Identifier: Apache-2.0
"""Which errors are shown, and what they are said to have in common."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from doorstate.dataset.store import PreparedDataset, open_dataset
from doorstate.evaluation.error_kinds import error_kinds_table
from doorstate.evaluation.errors_figure import common_errors_figure, surest_errors_figure
from doorstate.evaluation.results import load_results


def test_errors_are_counted_by_kind_with_their_ranges(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    poses = [row["pose_id"] for row in simulated.rows[::3]]
    wrong = {f"{pose}-open": "semi_open" for pose in poses[3:6]} | {f"{poses[1]}-closed": "open"}
    results = load_results(make_comparison(simulated, {"dgcnn": wrong}))
    first, second = csv.DictReader(error_kinds_table(results, simulated).to_csv().splitlines())
    assert (first["network"], first["true state"], first["taken for"], first["errors"]) == (
        "dgcnn",
        "closed",
        "open",
        "1",
    )
    assert second["errors"] == "3"
    missed = [simulated.rows[simulated.index_of(name)] for name in list(wrong)[:3]]
    angles = sorted(float(row["opening_angle_deg"]) for row in missed)
    assert second["opening angle, °"] == " / ".join(f"{angle:.0f}" for angle in angles)
    assert sum(int(part.split()[0]) for part in second["regions"].split(", ")) == 3


def test_figures_show_errors_of_each_network_and_shared_ones(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    poses = [row["pose_id"] for row in simulated.rows[::3]]
    wrong = {
        "dgcnn": {f"{pose}-open": "closed" for pose in poses[3:10]},
        "pointnet": {f"{poses[3]}-open": "semi_open"},
    }
    results = load_results(make_comparison(simulated, wrong))
    surest = surest_errors_figure(results, simulated)
    assert surest is not None
    labels = [axis.get_ylabel() for axis in surest.axes if axis.get_ylabel()]
    assert labels == ["pointnet\n1 errors", "dgcnn\n7 errors"]
    assert sum(bool(axis.get_title()) for axis in surest.axes) == 6, "five of a network at most"
    common = common_errors_figure(results, simulated)
    assert common is not None
    (title,) = [axis.get_title() for axis in common.axes if axis.get_title()]
    assert title == "open as closed or semi-open\nby pointnet, dgcnn"


def test_without_errors_there_is_nothing_to_show(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    folder = make_comparison(simulated)
    results, dataset = load_results(folder), open_dataset(simulated.folder)
    assert surest_errors_figure(results, dataset) is None
    assert common_errors_figure(results, dataset) is None
    assert error_kinds_table(results, dataset).rows == ()
