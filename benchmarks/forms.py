# SPDX-License-Identifier: Apache-2.0
"""The ways to compute one network that are compared, and how each is built in its worker."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple

from torch import Tensor, nn

from benchmarks.ports import build_port
from benchmarks.pyg import NETWORKS as PYG_NETWORKS
from benchmarks.pyg import build_pyg
from doorstate.networks import create_network
from doorstate.networks.base import PointNetwork
from doorstate.training.environment import compile_if_possible, has_fast_bf16

_PLAIN_FORMS = Path(__file__).resolve().parents[1] / "tests" / "networks"


class Form(NamedTuple):
    """One way to compute a network: ours, its plain twin of the tests, a public port, PyTorch Geometric's."""

    name: str
    kind: Literal["fast", "plain", "port", "pyg"]
    bf16: bool = False
    cached: bool = False
    compiled: bool = False


PLAIN, PORT, PYG = Form("plain fp32", "plain"), Form("port", "port"), Form("pyg", "pyg")
BASELINES = (PLAIN, PORT, PYG)
# Like with like: ports keep to 20 neighbours, DGCNN takes 40 from 2048 points on.
AS_PORTS: dict[str, dict[str, Any]] = {"dgcnn": {"k": 20}}


def forms_of(network: str, port: bool, pyg: bool, compiled: bool = False) -> list[Form]:
    """Forms a network is timed in, in the order in which they alternate."""
    bf16 = has_fast_bf16()
    best = "fast bf16" if bf16 else "fast fp32"
    forms = [Form("fast fp32", "fast")]
    forms += [Form("fast bf16", "fast", bf16=True)] if bf16 else []
    # PointNet looks at no neighbours.
    forms += [Form(f"{best}, neighbours cached", "fast", bf16, cached=True)] if network != "pointnet" else []
    forms += [Form(f"{best}, compiled", "fast", bf16, compiled=True)] if compiled else []
    forms.append(PLAIN)
    forms += [PORT] if port else []
    forms += [PYG] if pyg and network in PYG_NETWORKS else []
    return forms


def build_form(form: Form, network: str, checkout: Path | None, points: Tensor) -> nn.Module:
    """An untrained module with `training_loss(points, labels)` and `forward(points)`.

    Raises:
        RunError: a port or package is missing.
    """
    if form.kind == "port" and checkout is not None:
        return build_port(network, checkout)
    if form.kind == "pyg":
        return build_pyg(network)
    ours = create_network(network, **AS_PORTS.get(network, {}))
    if form.kind == "plain":
        return plain_form(ours)
    if form.compiled:
        ours.__dict__["training_loss"] = compile_if_possible(ours.training_loss)
    return _WithNeighbours(ours, points) if form.cached else ours


def plain_form(network: PointNetwork) -> nn.Module:
    """The twin that the tests compare a network with, every neighbourhood gathered."""
    sys.path.insert(0, str(_PLAIN_FORMS))
    plain: nn.Module = import_module("plain_networks").PlainForm(network)
    return plain


class _WithNeighbours(nn.Module):
    """A network that is told the neighbours of one training batch."""

    def __init__(self, network: PointNetwork, points: Tensor) -> None:
        super().__init__()
        self.network = network
        self.neighbourhoods = network.neighbourhoods(points)

    def training_loss(self, points: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """As the network's."""
        return self.network.training_loss(points, labels, neighbourhoods=self.neighbourhoods)
