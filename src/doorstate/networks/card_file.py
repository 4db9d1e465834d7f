# SPDX-License-Identifier: Apache-2.0
"""Card in a weights file; needs neither torch nor safetensors."""

from __future__ import annotations

from pathlib import Path

from doorstate.errors import WeightsError
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.tensor_file import read_header
from doorstate.types import STATES


def read_card(path: Path) -> WeightsCard:
    """Read the card of a weights file.

    Raises:
        WeightsError: the file is missing, damaged, or has no card.
    """
    try:
        return WeightsCard.parse(read_header(path).metadata[CARD_KEY])
    except KeyError as error:
        raise WeightsError("has no card: not a weights file of doorstate", path=path) from error
    except WeightsError as error:
        raise error if error.path is not None else error.located(path) from error


def check_card(card: WeightsCard, path: Path) -> None:
    """Check that a card is for the states and the scale of this version.

    Raises:
        WeightsError: it is for others.
    """
    if card.states != STATES or card.scale_m != card.normalization.scale_m:
        raise WeightsError(f"made for states {card.states} at scale {card.scale_m} m", path=path)
