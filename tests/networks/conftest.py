# SPDX-License-Identifier: Apache-2.0
"""Fixed seed for the initial weights of the networks."""

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
