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
from doorstate._files import read_csv
from doorstate.dataset.splits import Role
from doorstate.dataset.store import PreparedDataset
from doorstate.evaluation.figures import encode_figures, save_drawings
from doorstate.evaluation.table import Table, number
from doorstate.networks import create_network
from doorstate.networks.base import Neighbourhoods, PointNetwork
from doorstate.training import fit as training
from doorstate.training.fit import RunConfig, fit
from doorstate.training.run_folder import RunFolder

_COLORS = {"fast": "#0072B2", "plain": "#D55E00"}


def train_both(
    config: RunConfig, dataset: PreparedDataset, roles: dict[str, Role], folder: Path, seeds: int
) -> list[Group]:
    """Train one fold in both forms; a run that the folder holds already is not trained again.

    Returns:
        One row per run, its log by epoch and its metrics: both forms from seed 0, then fast from other seeds, which
        shows how far runs lie apart that differ in nothing but chance.
    """
    rows = []
    for form, seed in [("fast", 0), ("plain", 0), *(("fast", seed) for seed in range(1, seeds))]:
        config = config.model_copy(update={"seed": seed})
        run = folder / f"{config.network}-{form}-{seed}"
        build = training._build if form == "fast" else _build_plain
        with patch.object(training, "_build", build):
            metrics = fit(config, dataset, roles, run)
        log = [{key: float(value) for key, value in line.items()} for line in read_csv(RunFolder(run).log)]
        rows.append({"form": form, "seed": seed, "metrics": metrics, "log": log})
    return rows


def _build_plain(config: RunConfig) -> PointNetwork:
    """The network with the same parameters and names, trained in the plain way and tested in the fast one."""
    network = create_network(config.network, **training._network_options(config))
    plain: Any = plain_form(network)

    def training_loss(
        points: Tensor,
        labels: Tensor,
        label_smoothing: float = 0.0,
        neighbourhoods: Neighbourhoods | None = None,
    ) -> tuple[Tensor, Tensor]:
        result: tuple[Tensor, Tensor] = plain.training_loss(points, labels, label_smoothing)
        return result

    # On the instance, past nn.Module's own bookkeeping: weights are saved and loaded under the network's names.
    network.__dict__.update(training_loss=training_loss)
    return network


def curves_table(rows: list[Group]) -> Table:
    """One line per epoch, and the test fold last."""
    epochs = zip(*(row["log"] for row in rows), strict=True)
    lines = [
        (
            str(epoch + 1),
            *(number(line["train_loss"], 3) for line in lines),
            *(number(line["val_macro_f1"], 3) for line in lines),
        )
        for epoch, lines in enumerate(epochs)
    ]
    names = [f"{row['form']}, seed {row['seed']}" for row in rows]
    tested = [number(row["metrics"]["test_macro_f1"], 3) for row in rows]
    return Table(
        f"The same training, fast and plain: {rows[0]['metrics']['network']}",
        ("epoch", *(f"loss, {name}" for name in names), *(f"F1, {name}" for name in names)),
        (*lines, ("test", *("" for _ in rows), *tested)),
        "Training loss and validation macro-F1 of each epoch, then macro-F1 of the test fold. Runs of one seed have "
        "the same first weights, batches and dropout; fast runs of other seeds show what is chance.",
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
            first = row["seed"] == 0
            axis.plot(
                epochs,
                [line[key] for line in row["log"]],
                color=_COLORS[row["form"]],
                linewidth=2.0 if first else 0.8,
                label=row["form"] if first else "_",
            )
        axis.set(title=title, xlabel="epoch")
        axis.legend(frameon=False)
    save_drawings(encode_figures({name: figure}), folder)
