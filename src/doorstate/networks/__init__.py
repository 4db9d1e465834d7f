# SPDX-License-Identifier: Apache-2.0
"""Classifiers of point clouds by name: the five of the paper, and a multi-view CNN beside them."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

from doorstate.errors import ConfigError
from doorstate.networks.base import PointNetwork
from doorstate.networks.dgcnn import DGCNN
from doorstate.networks.mvcnn import MVCNN
from doorstate.networks.point2sequence import Point2Sequence
from doorstate.networks.pointcnn import PointCNN
from doorstate.networks.pointnet import PointNet
from doorstate.networks.pointnet2 import PointNet2

NETWORKS: dict[str, type[PointNetwork]] = {
    "pointnet": PointNet,
    "pointnet2": PointNet2,
    "dgcnn": DGCNN,
    "pointcnn": PointCNN,
    "point2sequence": Point2Sequence,
}
MULTI_VIEW: dict[str, type[PointNetwork]] = {"mvcnn": MVCNN}


def list_networks() -> list[str]:
    """Names of the point-based networks; `create_network` knows `mvcnn` too."""
    return list(NETWORKS)


def network_class(name: str) -> type[PointNetwork]:
    """What `create_network` builds.

    Raises:
        ConfigError: Unknown name.
    """
    known = NETWORKS | MULTI_VIEW
    if name not in known:
        close = get_close_matches(name, known, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
        raise ConfigError(f"there is no network {name!r}: {hint}")
    return known[name]


def create_network(name: str, num_classes: int = 3, **options: Any) -> PointNetwork:
    """Build an untrained network.

    Args:
        name: one of `list_networks()`, or `mvcnn`.
        num_classes: number of logits.
        options: keyword arguments of the network's class.

    Raises:
        ConfigError: Unknown name or option.
    """
    network = network_class(name)
    known = network.__init__.__kwdefaults__ or {}
    for option in options:
        if option not in known:
            raise ConfigError(f"network {name!r} has no option {option!r}: known are {', '.join(known)}")
    return network(num_classes, **options)  # type: ignore[call-arg]  # the base class takes none
