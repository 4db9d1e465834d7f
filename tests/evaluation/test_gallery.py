# SPDX-License-Identifier: Apache-2.0
"""Cards of errors, and clouds that read back to the millimetre."""

from __future__ import annotations

import base64
from collections.abc import Callable

import numpy as np
import pytest

from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation import gallery as gallery_module
from doorstate.evaluation.errors import missed_by
from doorstate.evaluation.gallery import build_gallery
from doorstate.evaluation.predictions import load_results
from tests.evaluation.conftest import MakeComparison


def test_cards_of_a_simulated_comparison(simulated: PreparedDataset, make_comparison: MakeComparison) -> None:
    twin, both, one = (simulated.rows[k]["sample_id"] for k in (2, 4, 6))
    wrong = {
        "pointnet": {twin: "semi_open", both: "open"},
        "dgcnn": {twin: "semi_open", both: "open", one: "open"},
    }
    gallery = build_gallery(load_results(make_comparison(simulated, wrong)), simulated)
    # Decidable ones first, then those that more methods missed.
    assert [card.sample_id for card in gallery.cards] == [both, one, twin]
    assert [card.undecidable for card in gallery.cards] == [False, False, True]
    assert [[wrong.method for wrong in card.predictions] for card in gallery.cards] == [
        ["pointnet", "dgcnn"],
        ["dgcnn"],
        ["pointnet", "dgcnn"],
    ]
    assert [(heading, [card.sample_id for card in cards]) for heading, cards in gallery.groups] == [
        (missed_by(2, 2), [both]),
        (missed_by(1, 2), [one]),
        ("Undecidable", [twin]),
    ]
    assert gallery.left_out == {"pointnet": 0, "dgcnn": 0}
    first = gallery.cards[0]
    assert first.picture is not None
    assert first.picture.startswith("data:image/jpeg;base64,/9j/")
    row = simulated.rows[4]
    assert any(row["region"] in fact for fact in first.facts)
    assert any(row["distance_band"] in fact for fact in first.facts)
    assert any("semi_open" in fact for fact in gallery.cards[2].facts)


def test_clouds_read_back_to_the_millimetre(
    simulated: PreparedDataset, make_comparison: MakeComparison
) -> None:
    name = simulated.rows[0]["sample_id"]
    gallery = build_gallery(load_results(make_comparison(simulated, {"dgcnn": {name: "open"}})), simulated)
    encoded = gallery.clouds[name]
    points = np.frombuffer(base64.b64decode(encoded["points"] or ""), dtype="<i2").reshape(-1, 3) / 1000
    np.testing.assert_allclose(points, simulated.cloud(0), atol=0.00051)
    parts = np.frombuffer(base64.b64decode(encoded["parts"] or ""), dtype=np.uint8)
    assert parts.tolist() == simulated.parts(0).tolist()  # type: ignore[union-attr]


def test_far_points_are_clipped(imported: PreparedDataset, make_comparison: MakeComparison) -> None:
    far = np.array(imported.clouds)
    far[:, 0, 0] = 1e4
    dataset = PreparedDataset(imported.folder, imported.description, imported.rows, far, None)
    gallery = build_gallery(load_results(make_comparison(dataset, {"dgcnn": {"open/3": "closed"}})), dataset)
    encoded = gallery.clouds["open/3"]
    points = np.frombuffer(base64.b64decode(encoded["points"] or ""), dtype="<i2").reshape(-1, 3)
    assert points[0, 0] == 32767
    assert encoded["parts"] is None
    assert gallery.cards[0].picture is None
    assert gallery.cards[0].facts == ()


def test_cards_carry_the_detections_of_a_rule(
    imported: PreparedDataset, make_comparison: MakeComparison, add_detections: Callable[..., None]
) -> None:
    folder = make_comparison(imported, {"dgcnn": {"open/3": "closed"}})
    add_detections(
        folder, "dgcnn", "open/3", [["wall", [[2, 1, 0], [2, -1, 0], [2, -1, 1]]], ["corner", [[1, 0, 0]]]]
    )
    gallery = build_gallery(load_results(folder), imported)
    outline, corner = gallery.detections["open/3"]["dgcnn"]
    assert outline == {"name": "wall", "points": [[2, 1, 0], [2, -1, 0], [2, -1, 1], [2, 1, 0]]}  # closed
    assert corner == {"name": "corner", "points": [[1, 0, 0]]}


def test_errors_of_highest_confidence_are_kept_and_the_rest_counted(
    imported: PreparedDataset, make_comparison: MakeComparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gallery_module, "CARDS_PER_METHOD", 2)
    folder = make_comparison(imported, {"dgcnn": {f"open/{k}": "closed" for k in range(5)}})
    for path in (folder / "runs" / "dgcnn").rglob("predictions.csv"):
        text = path.read_text()
        for name in ("open/1", "open/4"):
            text = text.replace(f"{name},open,closed,0.7,0.15,0.15", f"{name},open,closed,0.9,0.05,0.05")
        path.write_text(text)
    gallery = build_gallery(load_results(folder), imported)
    assert [card.sample_id for card in gallery.cards] == ["open/1", "open/4"]
    assert gallery.left_out == {"pointnet": 0, "dgcnn": 3}
    assert set(gallery.clouds) == {"open/1", "open/4"}
