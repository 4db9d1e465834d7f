# SPDX-License-Identifier: Apache-2.0
"""Outputs of an exported network in words, for its metadata and docs/onnx.md."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import NamedTuple

from doorstate.clouds.normalization import Input
from doorstate.inference.backends.onnx_backend import (
    PROBABILITIES,
    RAW_PROBABILITIES,
    REASON,
    REASONS,
    head_names,
)
from doorstate.inference.export.refusals import REFUSED
from doorstate.inference.gate import Gate
from doorstate.networks.card import WeightsCard
from doorstate.networks.heads import HEADS, STATE
from doorstate.types import DOOR, STATES

_PROGRAM: dict[Input, str] = {
    "whole": "before sampling, remove outliers and cut the cloud at max_depth_m of the card; refuse raw clouds as "
    "`gate` says. "
    "The graph makes its checks of points behind the camera, range, extent and view on the smallest and largest values "
    "of the sampled points; the number of points, the measured share, medians, quantiles, holes and, of open doors, "
    "the floor behind the opening are left to the program",
    "doorway": "before sampling, level the cloud, remove outliers, find the doorways and turn the points around each "
    "into its frame; refuse clouds and doorways in which too much is missing. The graph refuses points outside of the "
    "box of a crop",
}


class Output(NamedTuple):
    """Output of a file."""

    name: str
    type: str
    shape: tuple[str | int, ...]
    description: str


def list_outputs(card: WeightsCard) -> list[Output]:
    """Return the outputs in their order."""
    states = ", ".join(f"{number} {state}" for number, state in enumerate(STATES))
    outputs = [
        Output(STATE, "int64", ("batch",), f"{states}; {REFUSED} refused"),
        Output(REASON, "int64", ("batch",), "number of the reason in `reasons`; 0 with a state"),
        Output(
            PROBABILITIES,
            "float32",
            ("batch", len(STATES)),
            f"of {', '.join(STATES)}; they sum to one, and are all zero where the state is refused",
        ),
        Output(
            RAW_PROBABILITIES,
            "float32",
            ("batch", len(STATES)),
            "the same, refused or not: no evidence for a state",
        ),
    ]
    for name in head_names(card):
        refused = "refused or not" if name == DOOR else "NaN where the state is refused"
        shape = ("batch", len(HEADS[name].columns))
        outputs.append(Output(name, "float32", shape, f"{HEADS[name].description}; {refused}"))
    return outputs


def describe_refusals(card: WeightsCard, gate: Gate | None) -> dict[str, str]:
    """Return the metadata of a file about its outputs and refusals: JSON, and one text."""
    return {
        "outputs": json.dumps([output._asdict() for output in list_outputs(card)]),
        "reasons": json.dumps([code or "" for code in REASONS]),
        "gate": json.dumps(None if gate is None or card.input == "doorway" else asdict(gate)),
        "left_to_the_program": _PROGRAM[card.input],
    }
