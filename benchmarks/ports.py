# SPDX-License-Identifier: Apache-2.0
"""Public ports of three networks, loaded from a checkout; none of their code is in this repository."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from torch import Tensor, nn
from torch.nn import functional

from doorstate.errors import RunError
from doorstate.types import STATES

POINTNET, DGCNN = "yanx27/Pointnet_Pointnet2_pytorch", "antao97/dgcnn.pytorch"
REPOSITORIES = {"pointnet": POINTNET, "pointnet2": POINTNET, "dgcnn": DGCNN}
_FILES = {
    "pointnet": Path("models/pointnet_cls.py"),
    "pointnet2": Path("models/pointnet2_cls_ssg.py"),
    "dgcnn": Path("model.py"),
}


def build_port(network: str, checkout: Path) -> nn.Module:
    """Return a port with the methods of our networks.

    Raises:
        RunError: there is no checkout of the port.
    """
    file = checkout / _FILES[network]
    if not file.is_file():
        raise RunError(f"no checkout of {REPOSITORIES[network]}: {_FILES[network]} is missing", path=checkout)
    return _DGCNNPort(file) if network == "dgcnn" else _PointNetPort(file)


class _PointNetPort(nn.Module):
    """PointNet or PointNet++ of yanx27."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        sys.path.insert(0, str(file.parent))  # its modules import each other without a package
        module: Any = import_module(file.stem)
        self.network = module.get_model(len(STATES), normal_channel=False)
        self.loss = module.get_loss()

    def forward(self, points: Tensor) -> Tensor:
        """Return (B, 3) log probabilities of (B, N, 3) points."""
        logits: Tensor = self.network(points.mT)[0]
        return logits

    def training_loss(self, points: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """Return the port's own loss and the log probabilities."""
        logits, features = self.network(points.mT)
        return self.loss(logits, labels, features), logits


class _DGCNNPort(nn.Module):
    """DGCNN of antao97, with the numbers of its `main_cls.py`."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        # The port always takes the first GPU; this expression is replaced by the device of the input.
        source = file.read_text(encoding="utf-8").replace("torch.device('cuda')", "x.device")
        module = ModuleType("dgcnn_port")
        exec(compile(source, str(file), "exec"), module.__dict__)
        # Older versions have the shorter name.
        build: Any = getattr(module, "DGCNN_cls", None) or module.DGCNN
        arguments = SimpleNamespace(k=20, emb_dims=1024, dropout=0.5)
        self.network = build(arguments, output_channels=len(STATES))

    def forward(self, points: Tensor) -> Tensor:
        """Return (B, 3) logits of (B, N, 3) points."""
        logits: Tensor = self.network(points.mT.contiguous())  # the port takes a view
        return logits

    def training_loss(self, points: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """Return cross entropy and logits."""
        logits = self(points)
        return functional.cross_entropy(logits, labels), logits
