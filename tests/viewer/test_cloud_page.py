# SPDX-License-Identifier: Apache-2.0
"""The page holds what was asked and answered, loads nothing else, and does in a browser what its buttons say."""

from __future__ import annotations

import base64
import json
import re
from typing import Any

import numpy as np
import pytest

from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.types import Part
from doorstate.viewer.cloud_page import look, render_view
from doorstate.viewer.critical_points import critical_points
from doorstate.viewer.named_clouds import NamedCloud

Entry = dict[str, Any]


def decoded(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_an_entry_holds_the_points_that_were_looked_at(
    viewer: Predictor, sightings: list[NamedCloud], entries: list[Entry]
) -> None:
    prepared = prepare_cloud(sightings[1].cloud, CloudSpec(num_points=300, thin=True))
    shown = entries[1]["cloud"]
    points = decoded(shown["points"], "<i2").reshape(-1, 3) / 1000
    np.testing.assert_allclose(points, prepared.points, atol=0.00051)
    parts = decoded(shown["parts"], "u1")
    assert parts.tolist() == sightings[1].parts[prepared.indices].tolist()  # type: ignore[index]
    assert Part.LEAF in parts
    channels = decoded(entries[1]["channels"], "<u2") / 32
    counts = critical_points(viewer.network, prepared.points)
    assert channels.tolist() == counts.tolist()  # type: ignore[union-attr]
    answer = viewer(sightings[1].cloud)  # type: ignore[arg-type]
    said = entries[1]["answer"]
    assert said["probabilities"] == pytest.approx(answer.probabilities, abs=1e-6)
    assert (said["state"], said["points"]) == (answer.state.label, 300)  # type: ignore[union-attr]
    assert entries[1]["truth"] == "semi_open"


def test_an_entry_says_what_is_not_known(entries: list[Entry]) -> None:
    unnamed, glass, broken = entries[2:]
    assert (unnamed["cloud"]["parts"], unnamed["truth"], unnamed["shapes"]) == (None, "", [])
    assert glass["answer"]["state"] is None
    assert "glass" in glass["answer"]["reason"]
    assert "channels" not in glass, "the gate refused it: no network looked"
    assert broken == {"name": "broken.pcd", "truth": "", "error": "broken.pcd: is no PCD file"}


def test_an_entry_of_a_rule_holds_what_it_found(sightings: list[NamedCloud]) -> None:
    rule = RulePredictor.load("plane_state")
    entry = look(rule, sightings[1])
    found = rule(sightings[1].cloud).detections  # type: ignore[arg-type]
    assert [shape["name"] for shape in entry["shapes"]] == [shape.name for shape in found]
    assert len(found) > 0
    assert "channels" not in entry
    assert len(decoded(entry["cloud"]["points"], "<i2")) == 3 * 4096


def test_many_points_are_shown_as_the_first_4096(viewer: Predictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (6000, 3)).astype(np.float32)
    many = Predictor(viewer.network, viewer.card, 5000, gate=None)
    entry = look(many, NamedCloud("many", cloud, np.zeros(6000, np.uint8)))
    assert entry["answer"]["points"] == 5000
    assert len(decoded(entry["cloud"]["points"], "<i2")) == 3 * 4096
    assert len(decoded(entry["cloud"]["parts"] or "", "u1")) == 4096
    assert len(decoded(entry["channels"], "<u2")) == 4096


def test_the_page_asks_for_nothing_and_text_stays_text(viewer: Predictor, entries: list[Entry]) -> None:
    hostile = "</script><img src=http://door.example/x>"
    page = render_view(viewer, [entries[0] | {"name": hostile}])
    assert hostile not in page
    pattern = r'<script type="[a-z]+/[a-z]+" id="([a-z-]+)">(.*?)</script>'
    kept = dict(re.findall(pattern, page, flags=re.DOTALL))
    assert json.loads(kept["page-data"])["entries"][0]["name"] == hostile
    code = re.sub(pattern, "", page, flags=re.DOTALL)
    assert "default-src 'none'" in code
    assert "connect-src" not in code
    assert not re.search(r"https?://|fetch\(|XMLHttpRequest|import\(|url\(|@import", code)
    assert "connect-src 'self'" in render_view(viewer, [], live=True)
