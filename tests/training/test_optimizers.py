# SPDX-License-Identifier: Apache-2.0
"""Parameters and steps of the optimizers."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from doorstate.errors import ConfigError
from doorstate.networks import create_network, list_networks
from doorstate.training.optimizers import create_optimizers
from doorstate.training.recipes import COMMON, Recipe

MUON = COMMON.model_copy(update={"optimizer": "muon"})
needs_muon = pytest.mark.skipif(not hasattr(torch.optim, "Muon"), reason="torch is older than 2.9")


@pytest.mark.parametrize(
    "recipe", [COMMON, COMMON.model_copy(update={"optimizer": "sgd"}), pytest.param(MUON, marks=needs_muon)]
)
@pytest.mark.parametrize("network", list_networks())
def test_every_parameter_has_one_optimizer(network: str, recipe: Recipe) -> None:
    module = create_network(network)
    optimized = [
        id(parameter)
        for optimizer in create_optimizers(recipe, module)
        for group in optimizer.param_groups
        for parameter in group["params"]
    ]
    assert sorted(optimized) == sorted(id(parameter) for parameter in module.parameters())


@needs_muon
def test_muon_gets_the_matrices_between_hidden_layers() -> None:
    network = nn.Sequential(nn.Linear(3, 64), nn.Linear(64, 32), nn.BatchNorm1d(32), nn.Linear(32, 3))
    muon, adamw = create_optimizers(MUON, network)
    assert [tuple(parameter.shape) for parameter in muon.param_groups[0]["params"]] == [(32, 64)]
    assert isinstance(adamw, torch.optim.AdamW)


@needs_muon
def test_muon_steps_along_the_nearest_orthogonal_matrix() -> None:
    """The step of a square matrix is 0.2 sqrt(n) lr U V^T, where the gradient is U S V^T."""
    layer = nn.Linear(16, 16, bias=False)
    recipe = MUON.model_copy(update={"weight_decay": 0.0, "learning_rate": 1e-2})
    muon, _ = create_optimizers(recipe, nn.ModuleList([layer, nn.BatchNorm1d(16)]))
    before = layer.weight.detach().clone()
    gradient = torch.randn(16, 16, generator=torch.Generator().manual_seed(0)) + 4 * torch.eye(16)
    layer.weight.grad = gradient
    muon.step()
    left, _, right = torch.linalg.svd(gradient)
    step = (before - layer.weight.detach()) / (0.2 * 4 * 1e-2)
    # Five Newton-Schulz steps leave singular values between 0.7 and 1.2 (Jordan 2024).
    torch.testing.assert_close(torch.linalg.svdvals(step), torch.ones(16), atol=0.35, rtol=0)
    assert (step * (left @ right)).sum() / (step.norm() * 4) > 0.95


def test_torch_without_muon_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(torch.optim, "Muon", raising=False)
    with pytest.raises(ConfigError) as caught:
        create_optimizers(MUON, nn.Linear(32, 32))
    assert caught.value.field == "optimizer"
