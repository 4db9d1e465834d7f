# SPDX-License-Identifier: Apache-2.0
"""Weights that come with the package, by name: a network's own, or `<data set>-<network>`; needs no torch."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from doorstate.errors import WeightsError, unknown_name

PRETRAINED = Path(str(resources.files("doorstate.networks"))) / "pretrained"


def packaged_networks() -> list[str]:
    """Return the names of the packaged weights, sorted."""
    return sorted(path.stem for path in PRETRAINED.glob("*.safetensors"))


def packaged_weights(name: str) -> Path:
    """Return the path of packaged weights.

    Raises:
        WeightsError: no packaged weights of this name.
    """
    path = PRETRAINED / f"{name}.safetensors"
    if not path.is_file():
        raise unknown_name("packaged weights", name, packaged_networks(), WeightsError)
    return path


def packaged_graph(name: str) -> Path:
    """Return the path of the ONNX graph that takes packaged weights.

    Raises:
        WeightsError: no packaged weights of this name.
    """
    return packaged_weights(name).with_suffix(".onnx")
