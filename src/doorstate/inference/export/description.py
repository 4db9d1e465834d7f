# SPDX-License-Identifier: Apache-2.0
"""Metadata of an ONNX file: what goes in, what comes out, and the weights card."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from doorstate import __version__
from doorstate.clouds.normalization import SCALE_M
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.digest import card_with_digest
from doorstate.networks.heads import HEADS
from doorstate.types import STATES

if TYPE_CHECKING:
    from onnx import ModelProto

_DESCRIPTION = {
    "frame": "x forward, y left, z up, origin at the camera, gravity-aligned (ROS REP 103)",
    "units": "metres",
    "preparation": (
        "drop points that are not finite or (0, 0, 0), remove outliers, then keep as many as the input "
        "takes in farthest-point order; "
        f"centring and division by {SCALE_M} m are in the graph"
    ),
    "labels": ",".join(STATES),
    "heads": "; ".join(f"{head.name}: {head.description}" for head in HEADS.values()),
}


def describe(model: ModelProto, card: WeightsCard, more: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write the description of a graph, further entries and its card into its metadata."""
    import onnx

    onnx.helper.set_model_props(model, _DESCRIPTION | dict(more) | {CARD_KEY: card_with_digest(card)})
    model.producer_name, model.producer_version = "doorstate", __version__
