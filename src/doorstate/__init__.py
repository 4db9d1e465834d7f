# SPDX-License-Identifier: Apache-2.0
"""The state of a door from one depth-camera point cloud.

The public names are `Predictor`, `Prediction`, `DoorState`, `read_cloud`, `create_network` and `list_networks`; each is
imported when it is first used, so that `import doorstate` and the command line's help stay quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from doorstate.clouds.io import read_cloud
    from doorstate.deployment.predictor import Prediction, Predictor
    from doorstate.networks import create_network, list_networks
    from doorstate.types import DoorState

__version__ = "0.1.0"
__all__ = ["DoorState", "Prediction", "Predictor", "create_network", "list_networks", "read_cloud"]

_HOME = {
    "DoorState": "doorstate.types",
    "Prediction": "doorstate.deployment.predictor",
    "Predictor": "doorstate.deployment.predictor",
    "create_network": "doorstate.networks",
    "list_networks": "doorstate.networks",
    "read_cloud": "doorstate.clouds.io",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'doorstate' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
