# SPDX-License-Identifier: Apache-2.0
"""docs/zoo.md from the code and the weights in the package: the words are in zoo.md.j2, every figure is computed.

python tools/zoo_page.py
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

from doorstate._files import write_text
from doorstate.networks import create_network, list_networks
from doorstate.networks.card import WeightsCard
from doorstate.networks.packaged import packaged_networks, packaged_weights
from doorstate.networks.weights import read_card

from .results import NAMES
from .templates import template

PAGE = Path(__file__).resolve().parents[2] / "docs" / "zoo.md"


class Network(NamedTuple):
    """What `create_network` builds."""

    name: str
    title: str
    parameters: int


class Packaged(NamedTuple):
    """A weights file of the package."""

    card: WeightsCard
    megabytes: float
    sha256: str
    has_model_card: bool


def page() -> str:
    """The page as the code and the package are now."""
    titles = NAMES | {"mvcnn": "a multi-view CNN, beside the five"}
    networks = [
        Network(name, titles[name], sum(p.numel() for p in create_network(name).parameters()))
        for name in (*list_networks(), "mvcnn")
    ]
    packaged = {name: _packaged(packaged_weights(name)) for name in packaged_networks()}
    return template("zoo.md.j2").render(networks=networks, packaged=packaged)


def _packaged(path: Path) -> Packaged:
    data = path.read_bytes()
    return Packaged(
        read_card(path),
        len(data) / 1e6,
        hashlib.sha256(data).hexdigest(),
        path.with_suffix(".md").is_file(),
    )


if __name__ == "__main__":
    write_text(PAGE, page())
    print(PAGE)
