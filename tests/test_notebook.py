# SPDX-License-Identifier: Apache-2.0
"""The notebook runs from top to bottom, draws its plots, and holds no outputs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples" / "doors.ipynb"
CELLS = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]


def test_it_is_small_and_holds_no_outputs() -> None:
    assert NOTEBOOK.stat().st_size < 20_000
    code = [cell for cell in CELLS if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert len({cell["id"] for cell in CELLS}) == len(CELLS)


@pytest.mark.slow
def test_it_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    shown = []
    monkeypatch.setattr(plt, "show", lambda: shown.append(plt.gcf()) or plt.close("all"))
    names: dict[str, Any] = {}
    for cell in CELLS:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert len(shown) == 3
    assert all(figure.axes for figure in shown)
    assert [prediction.label for prediction in names["predictions"]] == ["closed", "semi_open", "open"]
    assert [row.state for row in names["rows"]] == ["closed", "semi_open", "open"]
    assert len(names["doors"]) == 2
    assert [state for state in dict.fromkeys(names["states"]) if state] == ["closed", "semi_open", "open"]
    assert "true: closed" in capsys.readouterr().out
