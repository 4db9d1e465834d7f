# SPDX-License-Identifier: Apache-2.0
"""The optimisers of a recipe: one for all of a network, or Muon for its matrices and AdamW for the rest."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import nn
from torch.optim import SGD, Adam, AdamW, Optimizer

from doorstate.errors import ConfigError
from doorstate.training.recipes import Recipe

_MATRIX = 16  # channels; to orthogonalise a layer from coordinates, or to a few answers, makes no sense


def create_optimizers(recipe: Recipe, network: nn.Module) -> list[Optimizer]:
    """Optimisers that share a network's parameters among them; each takes the recipe's rate at every step.

    Raises:
        ConfigError: this torch has no Muon.
    """
    if recipe.optimizer != "muon":
        return [_of_all(recipe, network.parameters())]
    if not hasattr(torch.optim, "Muon"):
        raise ConfigError(f"optimizer muon needs torch 2.9 or newer; this is {torch.__version__}")
    matrices: list[nn.Parameter] = []
    others: list[nn.Parameter] = []
    for parameter in network.parameters():
        is_matrix = parameter.ndim == 2 and min(parameter.shape) >= _MATRIX
        (matrices if is_matrix else others).append(parameter)
    # Liu et al. 2025 (arXiv:2502.16982): updates as large as AdamW's, so that its rates and weight decay serve both.
    muon = torch.optim.Muon(
        matrices, recipe.learning_rate, recipe.weight_decay, adjust_lr_fn="match_rms_adamw"
    )
    return [muon, _of_all(recipe, others)]


def _of_all(recipe: Recipe, parameters: Iterable[nn.Parameter]) -> Optimizer:
    rate, decay = recipe.learning_rate, recipe.weight_decay
    if recipe.optimizer == "sgd":
        return SGD(parameters, rate, momentum=recipe.momentum, weight_decay=decay)
    kind = Adam if recipe.optimizer == "adam" else AdamW
    return kind(parameters, rate, eps=recipe.adam_eps, weight_decay=decay)
