# SPDX-License-Identifier: Apache-2.0
"""Recipe of an adaptation: short, at a low rate, half of each batch from the place, statistics frozen."""

from __future__ import annotations

from doorstate.clouds.augmentation import Augmentation
from doorstate.networks.card import WeightsCard
from doorstate.training.recipes import DOORWAYS, Recipe, find_recipe

# Chosen by a trial on two simulated sites (paper/log.md): a higher rate forgets, and more steps change little.
LEARNING_RATE = 1e-4
SITE_SHARE = 0.5
_BATCH_SIZE = 16
_STEPS_PER_EPOCH = 4  # after each, a killed adaptation goes on
_STEPS_PER_FRAME, _STEPS = 4, (40, 160)  # fewest and most


def adaptation_recipe(card: WeightsCard, frames: int) -> Recipe:
    """Return the recipe for a number of frames to train on."""
    fewest, most = _STEPS
    steps = min(max(fewest, _STEPS_PER_FRAME * frames), most)
    is_crop = card.input == "doorway"
    recipe = find_recipe("doorways" if is_crop else "common", card.network)
    augmentation = DOORWAYS.augmentation if is_crop else Augmentation(yaw_deg=15.0, tilt_deg=1.0)
    return recipe.model_copy(
        update={
            "name": "adaptation",
            "epochs": steps // _STEPS_PER_EPOCH,
            "clouds_per_epoch": _STEPS_PER_EPOCH * _BATCH_SIZE,
            "batch_size": _BATCH_SIZE,
            "optimizer": "adamw",
            "learning_rate": LEARNING_RATE,
            "weight_decay": 0.0,
            "warmup": 0.1,
            "coarse_to_fine": (),
            "augmentation": augmentation,
            "no_door_share": 0.5 if is_crop else None,
            "own_share": SITE_SHARE,
            "frozen": True,
            "loss_weights": {"state": 3.0} if card.heads else {},
            "part_points": 256 if "parts" in card.heads else None,
            "batchnorm_eps": None,
        }
    )
