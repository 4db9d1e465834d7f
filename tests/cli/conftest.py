# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the command line tests."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture
def cloud() -> np.ndarray:
    """(500, 3) random points ahead of the camera."""
    rng = np.random.default_rng(0)
    return np.stack([rng.uniform(1, 3, 500), rng.uniform(-1, 1, 500), rng.uniform(-1, 1, 500)], 1).astype(
        np.float32
    )
