# SPDX-License-Identifier: Apache-2.0
"""Entries and HTML of the cloud page."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import pytest

from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.types import Part
from doorstate.viewer.cloud_page import Entry, make_entry, render_cloud_page
from doorstate.viewer.critical_points import critical_points
from doorstate.viewer.named_clouds import NamedCloud


def decoded(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_entry_holds_the_input_points_of_the_network(
    predictor: NetworkPredictor, clouds: list[NamedCloud], entries: list[Entry]
) -> None:
    prepared = prepare_cloud(clouds[1].cloud, CloudSpec(num_points=300, thin=True))
    encoded = entries[1]["cloud"]
    points = decoded(encoded["points"], "<i2").reshape(-1, 3) / 1000
    np.testing.assert_allclose(points, prepared.points, atol=0.00051)
    parts = decoded(encoded["parts"], "u1")
    assert parts.tolist() == clouds[1].parts[prepared.indices].tolist()  # type: ignore[index]
    assert Part.LEAF in parts
    channels = decoded(entries[1]["channels"], "<u2") / 32
    counts = critical_points(predictor.backend.network, prepared.points)
    assert channels.tolist() == counts.tolist()  # type: ignore[union-attr]
    prediction = predictor(clouds[1].cloud)  # type: ignore[arg-type]
    values = entries[1]["prediction"]
    assert values["probabilities"] == pytest.approx(prediction.probabilities, abs=1e-6)
    assert (values["state"], values["points"]) == (prediction.state, 300)  # type: ignore[union-attr]
    assert entries[1]["truth"] == "semi_open"


def test_entries_without_parts_state_or_cloud(entries: list[Entry]) -> None:
    unnamed, glass, broken = entries[2:]
    assert (unnamed["cloud"]["parts"], unnamed["truth"], unnamed["detections"]) == (None, "", [])
    assert glass["prediction"]["state"] is None
    assert glass["prediction"]["reason"]
    assert "channels" not in glass, "the gate abstained, so that no network was used"
    assert broken == {"name": "broken.pcd", "truth": "", "error": "not a PCD file"}


def test_entry_of_a_rule_holds_its_detections(clouds: list[NamedCloud]) -> None:
    rule = RulePredictor.from_name("plane_state")
    entry = make_entry(rule, clouds[1])
    detections = rule(clouds[1].cloud).detections  # type: ignore[arg-type]
    assert [detection["name"] for detection in entry["detections"]] == [
        detection.name for detection in detections
    ]
    assert len(detections) > 0
    assert "channels" not in entry
    assert len(decoded(entry["cloud"]["points"], "<i2")) == 3 * 4096


def test_entry_holds_at_most_4096_points(predictor: NetworkPredictor) -> None:
    cloud = np.random.default_rng(0).uniform(1, 3, (6000, 3)).astype(np.float32)
    many = NetworkPredictor(predictor.backend, 5000, gate=None)
    entry = make_entry(many, NamedCloud("many", cloud, np.zeros(6000, np.uint8)))
    assert entry["prediction"]["points"] == 5000
    assert len(decoded(entry["cloud"]["points"], "<i2")) == 3 * 4096
    assert len(decoded(entry["cloud"]["parts"] or "", "u1")) == 4096
    assert len(decoded(entry["channels"], "<u2")) == 4096


def test_page_is_self_contained_and_escapes_text(predictor: NetworkPredictor, entries: list[Entry]) -> None:
    hostile = "</script><img src=http://door.example/x>"
    page = render_cloud_page(predictor, [entries[0] | {"name": hostile}])
    assert hostile not in page
    pattern = r'<script type="[a-z]+/[a-z]+" id="([a-z-]+)">(.*?)</script>'
    scripts = dict(re.findall(pattern, page, flags=re.DOTALL))
    assert json.loads(scripts["page-data"])["entries"][0]["name"] == hostile
    code = re.sub(pattern, "", page, flags=re.DOTALL)
    assert "default-src 'none'" in code
    assert "unsafe-eval" not in code
    assert "connect-src 'none'" in code
    assert not re.search(r"https?://|fetch\(|XMLHttpRequest|import\(|url\(|@import", code)
    assert "connect-src 'self'" in render_cloud_page(predictor, [], live=True)
