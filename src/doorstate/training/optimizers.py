# SPDX-License-Identifier: Apache-2.0
"""Optimizers of a recipe: one for all parameters, or Muon for the matrices and AdamW for the rest."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import nn
from torch.optim import SGD, Adam, AdamW, Optimizer

from doorstate.errors import ConfigError
from doorstate.training.recipes import Recipe

# Muon takes matrices of at least this size: layers from coordinates or to few outputs gain nothing by orthogonalising.
_MIN_CHANNELS = 16


def create_optimizers(recipe: Recipe, network: nn.Module) -> list[Optimizer]:
    """Return optimizers that cover every parameter of a network once, with the recipe's learning rate.

    Raises:
        ConfigError: the recipe needs Muon, and this torch does not have it.
    """
    if recipe.optimizer != "muon":
        return [_single_optimizer(recipe, network.parameters())]
    if not hasattr(torch.optim, "Muon"):
        raise ConfigError(
            f"torch {torch.__version__} has no Muon",
            field="optimizer",
            expected="torch 2.9 or newer for muon",
        )
    matrices: list[nn.Parameter] = []
    rest: list[nn.Parameter] = []
    for parameter in network.parameters():
        is_matrix = parameter.ndim == 2 and min(parameter.shape) >= _MIN_CHANNELS
        (matrices if is_matrix else rest).append(parameter)
    # Liu et al. 2025 (arXiv:2502.16982): updates as large as AdamW's, so one rate and weight decay serve both.
    muon = torch.optim.Muon(
        matrices, recipe.learning_rate, recipe.weight_decay, adjust_lr_fn="match_rms_adamw"
    )
    return [muon, _single_optimizer(recipe, rest)]


def _single_optimizer(recipe: Recipe, parameters: Iterable[nn.Parameter]) -> Optimizer:
    rate, decay = recipe.learning_rate, recipe.weight_decay
    if recipe.optimizer == "sgd":
        return SGD(parameters, rate, momentum=recipe.momentum, weight_decay=decay)
    kind = Adam if recipe.optimizer == "adam" else AdamW
    return kind(parameters, rate, eps=recipe.adam_eps, weight_decay=decay)
