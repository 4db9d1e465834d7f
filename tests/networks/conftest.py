# SPDX-License-Identifier: Apache-2.0
"""Every test of the networks starts from the same weights."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch


@pytest.fixture(autouse=True)
def same_weights() -> Iterator[None]:
    """Seed the generator that initialises layers, and put it back afterwards."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        yield
