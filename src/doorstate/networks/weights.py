# SPDX-License-Identifier: Apache-2.0
"""Weights of a network as safetensors, with the card that describes them in the metadata; nothing is unpickled."""

from __future__ import annotations

from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from doorstate._files import atomic_path
from doorstate.errors import WeightsError
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.card_file import check_card, read_card
from doorstate.networks.digest import add_digest, card_with_digest
from doorstate.networks.head_layers import add_heads
from doorstate.networks.tensor_file import read_weights_file

_FLOATS = (torch.float16, torch.float32, torch.float64)


def save_weights(path: Path, network: PointNetwork, card: WeightsCard, half: bool = False) -> None:
    """Write parameters and running statistics, as float16 if `half`, in one step."""
    tensors = {
        name: (tensor.half() if half and tensor.is_floating_point() else tensor).detach().cpu().contiguous()
        for name, tensor in network.state_dict().items()
    }
    with atomic_path(path) as temporary:
        temporary.write_bytes(add_digest(save(tensors, {CARD_KEY: card_with_digest(card)})))


def load_weights(path: Path) -> tuple[PointNetwork, WeightsCard]:
    """Build the network of a weights file, in evaluation mode and float32.

    Raises:
        WeightsError: the file is missing, damaged, or for another network, other states or another scale.
    """
    card = read_card(path)
    check_card(card, path)
    try:
        network = create_network(card.network, num_classes=len(card.states), **card.network_options)
        add_heads(network, card.heads)
        load_into(network, path)
    except SafetensorError as error:
        raise WeightsError(f"cannot be read as safetensors ({error})", path=path) from error
    except RuntimeError as error:
        reason = str(error).splitlines()[0]
        raise WeightsError(f"does not fit network {card.network}: {reason}", path=path) from error
    return network.eval(), card


def load_into(network: PointNetwork, path: Path) -> None:
    """Copy the tensors of a weights file into a network, float16 as float32.

    Raises:
        WeightsError: the file differs from its digest, or a tensor is not finite or of another type than that of the
            network.
        RuntimeError: a tensor is missing, unknown, or of another shape.
    """
    tensors = load(read_weights_file(path))
    own = network.state_dict()
    for name, tensor in tensors.items():
        types = _FLOATS if name in own and own[name].is_floating_point() else (torch.int64,)
        if name in own and tensor.dtype not in types:
            expected = " or ".join(map(str, types))
            raise WeightsError(f"holds {tensor.dtype}", path=path, field=name, expected=expected)
        if not torch.isfinite(tensor).all():
            raise WeightsError("holds numbers that are not finite: damaged", path=path, field=name)
    network.load_state_dict(
        {
            name: tensor.to(torch.float32) if tensor.is_floating_point() else tensor
            for name, tensor in tensors.items()
        }
    )
