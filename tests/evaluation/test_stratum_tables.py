# SPDX-License-Identifier: Apache-2.0
"""Strata against plain loops over the manifest; undecidable frames by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.dataset.strata import BANDS, REGIONS
from doorstate.evaluation.results import load_results
from doorstate.evaluation.stratum_tables import (
    NO_STRATA,
    NO_TWINS,
    decidable_ceiling,
    decidable_table,
    has_strata,
    samples_table,
    state_table,
    undecidable_table,
)
from doorstate.evaluation.table import UNDEFINED, number
from doorstate.types import STATES


def test_sample_counts_are_those_of_a_plain_loop(simulated: PreparedDataset) -> None:
    rows = {row[:2]: [int(cell) for cell in row[2:]] for row in samples_table(simulated).rows}
    assert len(rows) == 4 * 6
    for state in STATES:
        for name, (low, high) in REGIONS.items():
            counts = [
                sum(
                    row["state"] == state and row["region"] == name and row["distance_band"] == band
                    for row in simulated.rows
                )
                for band in BANDS
            ]
            assert rows[state, f"{name} {low}–{high}°"] == [*counts, sum(counts)]
    assert rows["open", "all"][-1] == 40
    assert rows["all", "all"][-1] == 3 * 40


def test_state_table_is_that_of_a_plain_loop(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    wrong = {"pointnet": {row["sample_id"]: "open" for row in simulated.rows[::7]}}
    results = load_results(make_comparison(simulated, wrong))
    table = state_table(results, simulated, "open", 6)
    assert table.title == "Table 6. Open doors by angle region and distance"
    assert len(table.rows) == 2 * 3 * 6
    cells = {row[:3]: row[3:] for row in table.rows}
    for name, (low, high) in REGIONS.items():
        for column, band in enumerate(BANDS):
            inside = [
                (row["state"], wrong["pointnet"].get(row["sample_id"], row["state"]))
                for row in simulated.rows
                if row["region"] == name and row["distance_band"] == band
            ]
            hits = inside.count(("open", "open"))
            for metric, total in (
                ("recall", sum(true == "open" for true, _ in inside)),
                ("precision", sum(answer == "open" for _, answer in inside)),
            ):
                expected = f"{number(hits / total, 3)} ({hits}/{total})" if total else UNDEFINED
                assert cells["pointnet", metric, f"{name} {low}–{high}°"][column] == expected
    assert cells["dgcnn", "recall", "all"][-1] == f"1.000 ({40}/{40})"


def test_an_empty_stratum_is_undefined(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    unfinished = [("pointnet", fold) for fold in range(1, 5)]
    results = load_results(make_comparison(simulated, networks=["pointnet"], missing=unfinished))
    tested = [simulated.rows[simulated.index_of(name)] for name in results.pooled("pointnet").sample_ids]
    table = state_table(results, simulated, "closed", 4)
    found = {
        (row[2].split()[0], band): cell
        for row in table.rows
        for band, cell in zip(BANDS, row[3:-1], strict=True)
        if row[1] == "F1" and row[2] != "all"
    }
    present = {(row["region"], row["distance_band"]) for row in tested if row["state"] == "closed"}
    assert 0 < len(present) < len(found)
    for stratum, cell in found.items():
        assert cell == ("1.000" if stratum in present else UNDEFINED)


def test_data_without_strata_say_so(imported: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    results = load_results(make_comparison(imported))
    assert not has_strata(imported)
    for table in (samples_table(imported), state_table(results, imported, "closed", 4)):
        assert (table.rows, table.note) == ((), NO_STRATA)
    for table in (undecidable_table(imported), decidable_table(results, imported)):
        assert (table.rows, table.note) == ((), NO_TWINS)


def _row(pose: str, state: str, same: str = "") -> dict[str, str]:
    return {"sample_id": f"{pose}-{state}", "pose_id": pose, "state": state, "same_image_as": same}


@pytest.mark.parametrize(
    ("rows", "ceiling"),
    [
        ([_row("a", "closed"), _row("a", "semi_open"), _row("a", "open")], 1.0),
        ([_row("a", "closed"), _row("a", "semi_open", "open"), _row("a", "open", "semi_open")], 2 / 3),
        ([_row("a", s, " ".join(t for t in STATES if t != s)) for s in STATES], 1 / 3),
        ([_row("a", "open", "semi_open"), _row("b", "open", "semi_open")], 1.0),  # twins not in the sample
    ],
)
def test_ceiling_by_hand(rows: list[dict[str, str]], ceiling: float) -> None:
    assert decidable_ceiling(rows) == pytest.approx(ceiling)


def test_undecidable_frames_are_counted_apart(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    twin, other = simulated.rows[2]["sample_id"], simulated.rows[3]["sample_id"]
    wrong = {"dgcnn": {twin: "semi_open", other: "open"}}
    results = load_results(make_comparison(simulated, wrong))
    samples = 3 * 40
    assert [row[2] for row in undecidable_table(simulated).rows] == ["0", "1", "1", "2"]
    ceiling = number((samples - 1) / samples)
    assert ceiling in undecidable_table(simulated).note
    assert decidable_table(results, simulated).rows == (
        ("pointnet", "1.0000", "1.0000", "1.0000", ceiling),
        ("dgcnn", number((samples - 2) / samples), number((samples - 3) / (samples - 2)), "0.5000", ceiling),
    )
