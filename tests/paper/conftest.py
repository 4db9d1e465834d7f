# SPDX-License-Identifier: Apache-2.0
"""Comparisons with errors chosen by the test, shared with the tests of evaluation, and empty folders of the paper."""

from __future__ import annotations

from pathlib import Path

import pytest

from paper import paths
from tests.evaluation.conftest import make_comparison, simulated

__all__ = ["folders", "make_comparison", "simulated"]


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Empty folders in place of the repository's `runs/`, `results/` and `paper/experiments/`."""
    for name in ("RUNS", "RESULTS", "EXPERIMENTS"):
        (tmp_path / name.lower()).mkdir()
        monkeypatch.setattr(paths, name, tmp_path / name.lower())
    return tmp_path
