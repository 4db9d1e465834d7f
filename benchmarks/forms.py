# SPDX-License-Identifier: Apache-2.0
"""Forms of a network: the package's, its plain twin from the tests, a public port, PyTorch Geometric's."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple

import torch
from torch import Tensor, nn

from benchmarks.ports import build_port
from benchmarks.pyg import NETWORKS as PYG_NETWORKS
from benchmarks.pyg import build_pyg
from doorstate._devices import has_fast_bf16
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.training.environment import compile_if_possible

_PLAIN_FORMS = Path(__file__).resolve().parents[1] / "tests" / "networks"


class Form(NamedTuple):
    """One implementation of a network, with its precision and options."""

    name: str
    kind: Literal["fast", "plain", "port", "pyg"]
    bf16: bool = False
    cached: bool = False
    compiled: bool = False


PLAIN, PORT, PYG = Form("plain fp32", "plain"), Form("port", "port"), Form("pyg", "pyg")
BASELINES = (PLAIN, PORT, PYG)
# Ports use 20 neighbours for any number of points, while DGCNN here uses 40 from 2048 points on.
PORT_OPTIONS: dict[str, dict[str, Any]] = {"dgcnn": {"k": 20}}


def forms_of(network: str, port: bool, pyg: bool, compiled: bool = False, device: str = "cpu") -> list[Form]:
    """Return the forms of a network in the order in which they alternate."""
    bf16 = has_fast_bf16(torch.device(device))
    best = "fast bf16" if bf16 else "fast fp32"
    forms = [Form("fast fp32", "fast")]
    forms += [Form("fast bf16", "fast", bf16=True)] if bf16 else []
    # PointNet uses no neighbours.
    forms += [Form(f"{best}, neighbours cached", "fast", bf16, cached=True)] if network != "pointnet" else []
    forms += [Form(f"{best}, compiled", "fast", bf16, compiled=True)] if compiled else []
    forms.append(PLAIN)
    forms += [PORT] if port else []
    forms += [PYG] if pyg and network in PYG_NETWORKS else []
    return forms


def build_form(form: Form, network: str, checkout: Path | None, points: Tensor) -> nn.Module:
    """Return an untrained module with `training_loss(points, labels)` and `forward(points)`.

    Raises:
        RunError: a port or package is missing.
    """
    if form.kind == "port" and checkout is not None:
        return build_port(network, checkout)
    if form.kind == "pyg":
        return build_pyg(network)
    module = create_network(network, **PORT_OPTIONS.get(network, {}))
    if form.kind == "plain":
        return plain_form(module)
    if form.compiled:
        module.__dict__["training_loss"] = compile_if_possible(module.training_loss)
    return _WithNeighbours(module.to(points.device), points) if form.cached else module


def plain_form(network: PointNetwork) -> nn.Module:
    """Return the plain twin of a network from the tests, which gathers every neighbourhood."""
    sys.path.insert(0, str(_PLAIN_FORMS))
    plain: nn.Module = import_module("plain_networks").PlainForm(network)
    return plain


class _WithNeighbours(nn.Module):
    """Network with cached neighbours of one training batch."""

    def __init__(self, network: PointNetwork, points: Tensor) -> None:
        super().__init__()
        self.network = network
        self.neighbourhoods = network.neighbourhoods(points)

    def training_loss(self, points: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """Return the network's loss and logits."""
        return self.network.training_loss(points, labels, neighbourhoods=self.neighbourhoods)
