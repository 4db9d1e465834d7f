# SPDX-License-Identifier: Apache-2.0
"""The same training with fast and with plain layers: same seed, same batches, same dropout."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import patch

from matplotlib.figure import Figure
from torch import Tensor

from benchmarks.forms import plain_form
from benchmarks.store import Group
from doorstate.dataset.splits import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.figures import encode_figures, save_drawings
from doorstate.evaluation.table import Table, number
from doorstate.networks import create_network
from doorstate.networks.base import Neighbourhoods, PointNetwork
from doorstate.simulation.manifest import read_csv
from doorstate.training import fit as training
from doorstate.training.fit import RunConfig, fit
from doorstate.training.run_folder import RunFolder

FORMS = ("fast", "plain")
_COLORS = {"fast": "#0072B2", "plain": "#D55E00"}


def train_both(
    config: RunConfig, dataset: PreparedDataset, roles: dict[str, Role], folder: Path
) -> list[Group]:
    """Train one fold in both forms; a form that a folder holds already is not trained again.

    Returns:
        One row per form: its log by epoch and its metrics.
    """
    rows = []
    for form in FORMS:
        run = folder / f"{config.network}-{form}"
        build = training._build if form == "fast" else _build_plain
        with patch.object(training, "_build", build):
            metrics = fit(config, dataset, roles, run)
        log = [{key: float(value) for key, value in line.items()} for line in read_csv(RunFolder(run).log)]
        rows.append({"form": form, "metrics": metrics, "log": log})
    return rows


def _build_plain(config: RunConfig) -> PointNetwork:
    """The network with the same parameters and the same names, computed in the plain way."""
    network = create_network(config.network, **training._network_options(config))
    plain: Any = plain_form(network)

    def forward(points: Tensor, neighbourhoods: Neighbourhoods | None = None) -> Tensor:
        logits: Tensor = plain(points)
        return logits

    def training_loss(
        points: Tensor,
        labels: Tensor,
        label_smoothing: float = 0.0,
        neighbourhoods: Neighbourhoods | None = None,
    ) -> tuple[Tensor, Tensor]:
        result: tuple[Tensor, Tensor] = plain.training_loss(points, labels, label_smoothing)
        return result

    # On the instance, past nn.Module's own bookkeeping: weights are saved and loaded under the network's names.
    network.__dict__.update(forward=forward, training_loss=training_loss)
    return network


def curves_table(rows: list[Group]) -> Table:
    """One line per epoch, and the test fold last."""
    fast, plain = (row["log"] for row in rows)
    lines = [
        (
            str(int(a["epoch"]) + 1),
            *(
                number(line[key], digits)
                for key, digits in (("train_loss", 4), ("val_macro_f1", 4))
                for line in (a, b)
            ),
        )
        for a, b in zip(fast, plain, strict=True)
    ]
    tested = [number(row["metrics"]["test_macro_f1"], 4) for row in rows]
    return Table(
        f"The same training, fast and plain: {rows[0]['metrics']['network']}",
        ("epoch", "loss, fast", "loss, plain", "val F1, fast", "val F1, plain"),
        (*lines, ("test", "", "", *tested)),
        "Same seed, batches and dropout; training loss and macro-F1 of each epoch, then of the test fold.",
    )


def draw_curves(rows: list[Group], folder: Path, name: str) -> None:
    """Training loss and validation macro-F1 by epoch, both forms in each panel."""
    figure = Figure(figsize=(8, 3), layout="constrained")
    for axis, key, title in zip(
        figure.subplots(1, 2),
        ("train_loss", "val_macro_f1"),
        ("training loss", "validation macro-F1"),
        strict=True,
    ):
        for row in rows:
            epochs = [line["epoch"] + 1 for line in row["log"]]
            style = "-" if row["form"] == "fast" else "--"
            axis.plot(
                epochs,
                [line[key] for line in row["log"]],
                style,
                color=_COLORS[row["form"]],
                label=row["form"],
            )
        axis.set(title=title, xlabel="epoch")
        axis.legend(frameon=False)
    save_drawings(encode_figures({name: figure}), folder)
