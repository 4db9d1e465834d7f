# SPDX-License-Identifier: Apache-2.0
"""Caveats appear when they apply, and only then."""

from __future__ import annotations

import json
from dataclasses import replace

import pandas as pd

from doorstate.dataset.splits import PROTOCOLS as SPLIT_PROTOCOLS
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.caveats import PROTOCOLS, caveats
from doorstate.evaluation.metrics import macro_f1
from doorstate.evaluation.predictions import load_results
from doorstate.types import ABSTAINED
from tests.evaluation.conftest import MakeComparison


def test_partial_and_reduced_comparison(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    notes = caveats(load_results(make_comparison(simulated, missing=[("dgcnn", 1), ("dgcnn", 3)])))
    partial, samples, points, undecidable = notes
    assert "2 of 10" in partial
    assert "dgcnn" in partial
    assert "120" in samples
    assert "128" in points
    assert undecidable.startswith("2 ")


def test_unused_samples_and_folds(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(simulated, protocol="by-pose")
    document = json.loads((folder / "comparison.json").read_text()) | {"folds": 2}
    (folder / "comparison.json").write_text(json.dumps(document))
    results = load_results(folder)
    notes = caveats(results)
    unused = max(results.role_counts(fold)["unused"] for fold in range(2))
    assert unused > 0
    assert any(f" {unused} " in note for note in notes)
    assert any("2 of 5" in note for note in notes)


def test_full_comparison_has_none(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    folder = make_comparison(simulated)
    document = json.loads((folder / "comparison.json").read_text()) | {"num_points": 4096}
    (folder / "comparison.json").write_text(json.dumps(document))
    results = load_results(folder)
    manifest = pd.concat([results.manifest.assign(same_image_as=None)] * 40)
    assert caveats(replace(results, manifest=manifest)) == []


def test_imported_data_have_two_more(imported: PreparedDataset, make_comparison: MakeComparison) -> None:
    assert len(caveats(load_results(make_comparison(imported)))) == 4


def test_clouds_left_out_count_as_errors(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    results = load_results(make_comparison(simulated))
    note = caveats(results, {"closed": 3, "no_door": 2})[0]
    assert note.startswith("5 ")
    assert "3 closed, 2 no_door" in note
    for method in results.methods:
        tested = results.tested_by(method)
        missed = tested[tested["state"] == "closed"].iloc[:3].assign(predicted=ABSTAINED)
        assert f"{method} {macro_f1(pd.concat([tested, missed])):.4f}" in note


def test_every_protocol_is_explained() -> None:
    assert set(PROTOCOLS) == set(SPLIT_PROTOCOLS)
