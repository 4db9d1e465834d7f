# SPDX-License-Identifier: Apache-2.0
"""Metadata of an ONNX file: what goes in, what comes out, and the weights card."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from doorstate import __version__
from doorstate.clouds.normalization import Input
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.digest import card_with_digest
from doorstate.networks.heads import HEADS
from doorstate.types import STATES

if TYPE_CHECKING:
    from onnx import ModelProto

_FRAMES: dict[Input, str] = {
    "whole": "x forward, y left, z up, origin at the camera, gravity-aligned (ROS REP 103)",
    "doorway": "x along the wall to the left as the camera sees it, y towards the camera, z up; origin on the floor in "
    "the middle of the opening, on the camera's face of the wall",
}
_PREPARATION = (
    "drop points that are not finite or (0, 0, 0), remove outliers, then keep as many as the input takes in "
    "farthest-point order; centring on {centre} and division by {scale_m} m are in the graph"
)


def describe(model: ModelProto, card: WeightsCard, more: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write the description of a graph, further entries and its card into its metadata."""
    import onnx

    normalization = card.normalization
    description = {
        "frame": _FRAMES[card.input],
        "units": "metres",
        "preparation": _PREPARATION.format(
            centre="their mean" if normalization.centre_m is None else normalization.centre_m,
            scale_m=normalization.scale_m,
        ),
        "labels": ",".join(STATES),
        "heads": "; ".join(f"{head.name}: {head.description}" for head in HEADS.values()),
    }
    onnx.helper.set_model_props(model, description | dict(more) | {CARD_KEY: card_with_digest(card)})
    model.producer_name, model.producer_version = "doorstate", __version__
