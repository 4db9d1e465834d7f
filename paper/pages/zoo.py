# SPDX-License-Identifier: Apache-2.0
"""Values of docs/zoo.md: networks and packaged weights."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any, NamedTuple

from doorstate.networks.answers import Answers, packaged_answers
from doorstate.networks.card import WeightsCard
from doorstate.networks.card_file import read_card
from doorstate.networks.packaged import packaged_networks, packaged_weights
from doorstate.networks.parameters import NUM_PARAMETERS


class PackagedFile(NamedTuple):
    """Weights file of the package."""

    card: WeightsCard
    megabytes: float
    sha256: str
    answers: Answers | None  # None until they are measured


def content() -> Mapping[str, Any]:
    """Return the values of the page."""
    return {
        "parameters": NUM_PARAMETERS,
        "packaged": {name: _packaged(name) for name in packaged_networks()},
    }


def _packaged(name: str) -> PackagedFile:
    path = packaged_weights(name)
    data = path.read_bytes()
    return PackagedFile(
        read_card(path), len(data) / 1e6, hashlib.sha256(data).hexdigest(), packaged_answers().get(name)
    )
