# SPDX-License-Identifier: Apache-2.0
"""The state of a door from one depth-camera point cloud.

The public names are `Predictor`, `Prediction`, `Door`, `DoorHint`, `Gate`, `StateFilter`, `wait_for`, `DoorState`,
`read_cloud`, `ReadOptions`, `create_network` and `list_networks`; each is imported when it is first used, so that
`import doorstate` and the command line's help stay quick.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # importing the module typing takes longer than all that is imported here
if TYPE_CHECKING:
    from doorstate.inference.door import Door
    from doorstate.inference.gate import Gate
    from doorstate.inference.known import DoorHint
    from doorstate.inference.prediction import Prediction
    from doorstate.inference.predictor import Predictor
    from doorstate.inference.state_filter import StateFilter
    from doorstate.inference.waiting import wait_for
    from doorstate.io.options import ReadOptions
    from doorstate.io.readers import read_cloud
    from doorstate.networks import create_network, list_networks
    from doorstate.types import DoorState

__version__ = "0.1.0"
__all__ = [
    "Door",
    "DoorHint",
    "DoorState",
    "Gate",
    "Prediction",
    "Predictor",
    "ReadOptions",
    "StateFilter",
    "create_network",
    "list_networks",
    "read_cloud",
    "wait_for",
]

_HOME = {
    "Door": "doorstate.inference.door",
    "DoorHint": "doorstate.inference.known",
    "DoorState": "doorstate.types",
    "Gate": "doorstate.inference.gate",
    "Prediction": "doorstate.inference.prediction",
    "Predictor": "doorstate.inference.predictor",
    "ReadOptions": "doorstate.io.options",
    "StateFilter": "doorstate.inference.state_filter",
    "create_network": "doorstate.networks",
    "list_networks": "doorstate.networks",
    "read_cloud": "doorstate.io.readers",
    "wait_for": "doorstate.inference.waiting",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'doorstate' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
