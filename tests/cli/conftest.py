# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the command line tests."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate.cli import progress


@pytest.fixture(autouse=True)
def _no_progress_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine must not add lines to standard error."""
    monkeypatch.setattr(progress, "FIRST_LINE_S", 3600.0)


@pytest.fixture
def cloud() -> np.ndarray:
    """(500, 3) random points ahead of the camera."""
    rng = np.random.default_rng(0)
    return np.stack([rng.uniform(1, 3, 500), rng.uniform(-1, 1, 500), rng.uniform(-1, 1, 500)], 1).astype(
        np.float32
    )
