# SPDX-License-Identifier: Apache-2.0
"""Random streams: one for each sample and stage, none of which moves when another stage draws more or is left out."""

from __future__ import annotations

import hashlib
import zlib

import numpy as np


def sample_seed(seed: int, sample_id: str) -> int:
    """A seed of 64 bits for one sample of a data set."""
    return int.from_bytes(hashlib.sha256(f"{seed} {sample_id}".encode()).digest()[:8], "little")


def stage_rng(seed: int, stage: str) -> np.random.Generator:
    """The stream of one stage of one sample."""
    # Spawn keys, unlike longer seeds, are never one another's beginning padded with zeros (paper/log.md).
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(stage.encode()),)))
