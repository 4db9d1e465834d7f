# SPDX-License-Identifier: Apache-2.0
"""Random streams, one for each sample and stage: a change of one stage leaves the numbers of the others as they are."""

from __future__ import annotations

import hashlib
import zlib

import numpy as np


def sample_seed(seed: int, sample_id: str) -> int:
    """Return a 64-bit seed for one sample of a data set."""
    return int.from_bytes(hashlib.sha256(f"{seed} {sample_id}".encode()).digest()[:8], "little")


def stage_rng(seed: int, stage: str) -> np.random.Generator:
    """Return the stream of one stage of one sample."""
    # Spawn keys, because numpy pads short seeds with zeros: [1] and [1, 0] would be one stream.
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(stage.encode()),)))
