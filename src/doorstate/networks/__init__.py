# SPDX-License-Identifier: Apache-2.0
"""Classifiers of point clouds by name: the five of the comparison, and a multi-view CNN.

Importing this package imports no torch: a network's module is loaded when its class is first needed.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from doorstate.errors import ConfigError, needs_extra, unknown_name

if TYPE_CHECKING:
    from doorstate.networks.base import PointNetwork

NETWORKS = {
    "pointnet": "doorstate.networks.pointnet:PointNet",
    "pointnet2": "doorstate.networks.pointnet2:PointNet2",
    "dgcnn": "doorstate.networks.dgcnn:DGCNN",
    "pointcnn": "doorstate.networks.pointcnn:PointCNN",
    "point2sequence": "doorstate.networks.point2sequence:Point2Sequence",
}
"""Point networks by name, as module:class."""
MULTI_VIEW = {"mvcnn": "doorstate.networks.mvcnn:MVCNN"}
"""Networks on rendered views by name, as module:class."""


def list_networks() -> list[str]:
    """Return the names of the point networks; `create_network` also builds `mvcnn`."""
    return list(NETWORKS)


def network_class(name: str) -> type[PointNetwork]:
    """Return the class of a network.

    Raises:
        ConfigError: unknown name.
        MissingExtraError: torch is not installed.
    """
    places = NETWORKS | MULTI_VIEW
    if name not in places:
        raise unknown_name("network", name, places)
    module, _, class_name = places[name].partition(":")
    with needs_extra(f"network {name}"):
        return cast("type[PointNetwork]", getattr(import_module(module), class_name))


def create_network(
    name: str, pretrained: bool | str = False, *, num_classes: int = 3, **options: Any
) -> PointNetwork:
    """Build a network.

    Args:
        name: one of `list_networks()`, or `mvcnn`.
        pretrained: True loads the packaged weights of this name, a string those of another name of
            `packaged_networks()`, such as "ogurob-pointnet"; the network then has their heads and options, and is
            returned in evaluation mode. False leaves the network untrained.
        num_classes: number of logits.
        options: keyword arguments of the network's class.

    Raises:
        ConfigError: unknown name or option, options of pretrained weights, or weights of another network.
        WeightsError: no such packaged weights.
        MissingExtraError: torch is not installed.
    """
    network = network_class(name)
    if pretrained:
        if options or num_classes != 3:
            raise ConfigError("packaged weights define the classes and options of their network")
        return _load_pretrained(name, name if pretrained is True else pretrained)
    defaults = network.__init__.__kwdefaults__ or {}
    for option in options:
        if option not in defaults:
            raise unknown_name(f"{name} option", option, defaults)
    return network(num_classes, **options)  # type: ignore[call-arg]  # the base class takes none


def _load_pretrained(name: str, weights: str) -> PointNetwork:
    from doorstate.networks.packaged import packaged_weights
    from doorstate.networks.weights import load_weights

    network, card = load_weights(packaged_weights(weights))
    if card.network != name:
        raise ConfigError(f"the weights {weights!r} are for {card.network}, not {name}")
    return network
