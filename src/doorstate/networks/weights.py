# SPDX-License-Identifier: Apache-2.0
"""Weights as safetensors with what is needed to use them; nothing is unpickled."""

from __future__ import annotations

from pathlib import Path

import torch
from pydantic import ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from doorstate._files import atomic_path
from doorstate.clouds.normalization import SCALE_M
from doorstate.errors import WeightsError
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import WeightsCard
from doorstate.networks.head_layers import add_heads
from doorstate.types import STATES


def save_weights(path: Path, network: PointNetwork, card: WeightsCard, half: bool = False) -> None:
    """Write parameters and running statistics, as float16 if `half`, in one step."""
    tensors = {
        name: (tensor.half() if half and tensor.is_floating_point() else tensor).detach().cpu().contiguous()
        for name, tensor in network.state_dict().items()
    }
    with atomic_path(path) as temporary:
        save_file(tensors, temporary, metadata={"doorstate": card.model_dump_json()})


def read_card(path: Path) -> WeightsCard:
    """What a weights file is for.

    Raises:
        WeightsError: missing, damaged, or no weights of ours.
    """
    if not path.is_file():
        raise WeightsError(f"{path}: no such weights file")
    try:
        with safe_open(path, framework="pt") as weights:
            metadata = weights.metadata() or {}
        return WeightsCard.model_validate_json(metadata["doorstate"])
    except (OSError, SafetensorError) as error:
        raise WeightsError(f"{path}: cannot be read as safetensors ({error})") from error
    except (KeyError, ValidationError) as error:
        raise WeightsError(
            f"{path}: does not say which network it is for: no weights of doorstate"
        ) from error


def load_weights(path: Path) -> tuple[PointNetwork, WeightsCard]:
    """The network of a weights file, in evaluation mode, float32.

    Raises:
        WeightsError: missing, damaged, made for another network, other states or another scale.
    """
    card = read_card(path)
    if card.states != STATES or card.scale_m != SCALE_M:
        raise WeightsError(f"{path}: made for states {card.states} at scale {card.scale_m} m")
    try:
        network = create_network(card.network, num_classes=len(card.states), **card.network_options)
        add_heads(network, card.heads)
        load_into(network, path)
    except RuntimeError as error:
        raise WeightsError(
            f"{path}: does not fit network {card.network}: {str(error).splitlines()[0]}"
        ) from error
    return network.eval(), card


def load_into(network: PointNetwork, path: Path) -> None:
    """Copy the tensors of a weights file into a network that fits."""
    with safe_open(path, framework="pt") as weights:
        state = {name: weights.get_tensor(name) for name in weights.keys()}  # noqa: SIM118 - not a dict
    network.load_state_dict(
        {
            name: tensor.to(torch.float32) if tensor.is_floating_point() else tensor
            for name, tensor in state.items()
        }
    )
