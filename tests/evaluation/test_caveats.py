# SPDX-License-Identifier: Apache-2.0
"""Reservations appear when they apply, and only then."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from doorstate.dataset.splits import PROTOCOLS as SPLIT_PROTOCOLS
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.caveats import PROTOCOLS, caveats
from doorstate.evaluation.results import load_results
from doorstate.evaluation.stratum_tables import NO_STRATA, NO_TWINS


def test_a_partial_comparison_says_what_is_missing(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    folder = make_comparison(simulated, missing=[("dgcnn", 1), ("dgcnn", 3)])
    notes = caveats(load_results(folder), simulated)
    assert notes[0].startswith("Partial: 2 of 10 runs are not finished (dgcnn fold 1, 3).")
    assert any("120 samples, the paper has 4059" in note for note in notes)
    assert any("128 points a cloud, the paper has 4096" in note for note in notes)
    assert any(note.startswith("2 frames look the same") for note in notes)


def test_unused_samples_and_folds(simulated: PreparedDataset, make_comparison: Callable[..., Path]) -> None:
    folder = make_comparison(simulated, protocol="by-pose")
    document = json.loads((folder / "comparison.json").read_text()) | {"folds": 2}
    (folder / "comparison.json").write_text(json.dumps(document))
    results = load_results(folder)
    notes = caveats(results, simulated)
    unused = max(results.role_counts(fold)["unused"] for fold in range(2))
    assert unused > 0
    assert any(f"up to {unused} samples" in note for note in notes)
    assert any(note.startswith("Only 2 of 5 folds") for note in notes)
    assert not any(note.startswith("Partial") for note in notes)


def test_a_full_comparison_has_nothing_to_confess(
    simulated: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    folder = make_comparison(simulated)
    document = json.loads((folder / "comparison.json").read_text()) | {"num_points": 4096}
    (folder / "comparison.json").write_text(json.dumps(document))
    rows = [row | {"same_image_as": ""} for row in simulated.rows] * 40
    whole = PreparedDataset(simulated.folder, simulated.description, rows, simulated.clouds, None)
    assert caveats(load_results(folder), whole) == []


def test_imported_data_say_what_they_do_not_know(
    imported: PreparedDataset, make_comparison: Callable[..., Path]
) -> None:
    notes = caveats(load_results(make_comparison(imported)), imported)
    assert {NO_STRATA, NO_TWINS} <= set(notes)


def test_every_protocol_is_explained() -> None:
    assert set(PROTOCOLS) == set(SPLIT_PROTOCOLS)
