# SPDX-License-Identifier: Apache-2.0
"""Sessions of onnxruntime."""

from __future__ import annotations

from importlib.resources import files

import onnxruntime
import pytest

from doorstate._onnxruntime import open_session


def test_every_session_is_opened_without_telemetry(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    monkeypatch.setattr(onnxruntime, "disable_telemetry_events", lambda: calls.append("off"))
    model = files("doorstate.doorways").joinpath("column_scorer.onnx").read_bytes()
    session = open_session(model, onnxruntime.SessionOptions())
    assert calls == ["off"]
    assert session.get_providers() == ["CPUExecutionProvider"]
