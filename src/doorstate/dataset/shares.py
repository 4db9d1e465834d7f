# SPDX-License-Identifier: Apache-2.0
"""Share of the scenes of a data set, for curves of accuracy against the number of scenes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from doorstate.dataset.splits import origin
from doorstate.dataset.store import PreparedDataset


def samples_of_share(dataset: PreparedDataset, sample_ids: Iterable[str], share: float) -> list[str]:
    """Return the samples of a share of the scenes, in order.

    The scenes of a share depend on their names alone, and those of a smaller share are among them.
    """
    if share == 1:
        return list(sample_ids)
    return [sample for sample in sample_ids if _place(origin(dataset.rows[dataset.index_of(sample)])) < share]


def _place(name: str) -> float:
    """Return a number in [0, 1) that looks random."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:6]) / 2**48
