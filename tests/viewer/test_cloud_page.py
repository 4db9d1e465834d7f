# SPDX-License-Identifier: Apache-2.0
"""Entries and HTML of the cloud page."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import pytest

from doorstate.clouds.leveling import Leveling
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.io.options import ReadOptions
from doorstate.io.rotations import tilt_matrix
from doorstate.types import Part
from doorstate.viewer.cloud_page import Entry, Shown, make_entry, render_cloud_page
from doorstate.viewer.critical_points import critical_points
from doorstate.viewer.named_clouds import NamedCloud
from tests.inference.scripted_doorways import FLOOR_M, doorway, outputs, room, scripted_predictor


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


def test_doors_of_a_tilted_cloud_are_drawn_over_the_level_one(monkeypatch: pytest.MonkeyPatch) -> None:
    cloud, rotation = room(), np.array(tilt_matrix(5.0, 20.0))
    tilted = (cloud @ rotation).astype(np.float32)
    level = Leveling(cloud, rotation, "floor", 0.4, FLOOR_M)
    script = [outputs("open"), outputs("closed", 0.9), outputs("closed", 0.1)]
    found = [doorway(3.0), doorway(2.5, 40.0), doorway(2.0, -50.0)]
    for refused in (False, True):
        predictor = scripted_predictor(monkeypatch, found, script, leveling=level)
        entry = make_entry(
            predictor, NamedCloud("tilted", tilted, pose=ReadOptions().pose()), shown=Shown(False, refused)
        )
        labels = [line["label"] for line in entry["detections"] if line["label"]]
        assert labels == ["1: open", "90°", "2: closed", "0°", *(["no door (0.10)"] * refused)]
    frame = next(line for line in entry["detections"] if line["name"] == "door frame")
    np.testing.assert_allclose(np.array(frame["points"])[:, 0], 3.0, atol=1e-3)
    whole = decoded(entry["whole"]["points"], "<i2").reshape(-1, 3) / 1000
    assert entry["floor_z_m"] == pytest.approx(FLOOR_M, abs=0.05)
    assert whole[:, 2].min() >= FLOOR_M - 0.001
    assert decoded(entry["cloud"]["points"], "<i2").size == 3 * 3 * 128
    assert "channels" not in entry
    assert entry["plan"].startswith("<svg")
    assert "open 90°" in entry["plan"]
    assert [door["state"] for door in entry["prediction"]["doors"]] == ["open", "closed"]
    assert entry["prediction"]["tilt"]["pitch_deg"] == pytest.approx(20.0)


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
