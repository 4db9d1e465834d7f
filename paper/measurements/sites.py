# SPDX-License-Identifier: Apache-2.0
"""Adaptation on simulated sites: three doors of a building are labelled, the other three are tested.

Every site and every number of frames has a file of its own, so that a stopped measurement goes on.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from doorstate._documents import read_json
from doorstate._files import write_text
from doorstate._jobs import Progress, WorkersOrEngine, no_progress
from doorstate.dataset.labelled import LabelledFrame, labelled_frames
from doorstate.evaluation.adaptation import AFTER, BEFORE, score_before_and_after
from doorstate.evaluation.table import (
    Column,
    Table,
    count_column,
    interval_column,
    label_column,
    number_column,
)
from doorstate.simulation.draw.building.site import DOORS
from doorstate.simulation.settings import settings_for
from doorstate.simulation.writer import simulate_dataset
from doorstate.training.adaptation.adapt import Adaptation
from doorstate.training.adaptation.simulated import Parts, simulate_for
from doorstate.types import STATES

TESTED_FRAMES = 45  # of the three doors that are not labelled
_RESAMPLES = 10_000
_HALF = DOORS // 2


class Site(NamedTuple):
    """Frames of one building, each of a pose of its own: those to label in order, and those to test."""

    labelled: list[LabelledFrame]
    tested: list[LabelledFrame]


def simulate_site(
    seed: int, labelled: int, folder: Path, sensor: str, workers: WorkersOrEngine = None
) -> Site:
    """Simulate the building of a seed as depth images, and choose one state of each pose in turn."""
    views = 2 * max(labelled, TESTED_FRAMES)
    name = folder / f"site-{seed}-{views}-{sensor}"
    simulate_dataset(name, settings_for("site", seed, scenes=views, raw=("depth",), sensor=sensor), workers)
    by_view: dict[int, dict[str, LabelledFrame]] = {}
    for frame in labelled_frames(name / "depth"):
        by_view.setdefault(int(frame.file.split("-")[2]), {})[frame.label] = frame
    # Doors take turns, so that a step of the state after each round shows every door in every state.
    chosen = [by_view[view][STATES[(view + view // DOORS) % len(STATES)]] for view in sorted(by_view)]
    ours = [frame for view, frame in enumerate(chosen) if view % DOORS < _HALF]
    others = [frame for view, frame in enumerate(chosen) if view % DOORS >= _HALF]
    return Site(ours[:labelled], others[:TESTED_FRAMES])


def measure_site(
    network: str,
    weights: Path,
    seed: int,
    counts: Sequence[int],
    folder: Path,
    sensor: str,
    workers: WorkersOrEngine = None,
    parts: Parts | None = None,
    changes: dict[str, Any] | None = None,
) -> list[dict[str, Any]]:
    """Adapt weights to one site with each number of frames, and test them before and after.

    Args:
        network: name of the weights in the table.
        weights: weights file.
        seed: seed of the building.
        counts: numbers of labelled frames.
        folder: folder of all files; results in it are not measured again.
        sensor: camera of the site.
        workers: processes, None is one per processor; or an engine.
        parts: simulated clouds to mix in; None: the usual ones.
        changes: fields of the recipe to change.
    """
    rows = []
    for count in counts:
        path = folder / "results" / f"{network}-{seed}-{count}-{sensor}.json"
        if not path.is_file():
            site = simulate_site(seed, max(counts), folder, sensor, workers)
            adaptation = Adaptation(site.labelled[:count], weights, folder / "adapted", changes=changes)
            prepared = adaptation.prepare(workers)
            simulated = simulate_for(adaptation.card, folder / "simulated", workers, parts=parts)
            adaptation.train(prepared.dataset, simulated)
            out = adaptation.folder / "weights.safetensors"
            adapted = adaptation.finish(prepared.dataset, simulated, out)
            scores = score_before_and_after(weights, out, site.tested)
            assert scores is not None
            row: dict[str, Any] = {"network": network, "site": seed, "count": count}
            for of in scores.to_json()["scores"]:
                if (name := of["method"]) in (BEFORE, AFTER):
                    answered = of["frames"] - of["abstained"]
                    row |= {
                        f"frames_{name}": of["frames"],
                        f"f1_{name}": of["f1"],
                        f"answered_{name}": answered,
                        f"wrong_{name}": answered - of["correct"],
                    }
            row |= {
                "simulated_before": adapted.simulated_f1_before,
                "simulated_after": adapted.simulated_f1_after,
            }
            write_text(path, json.dumps(row, indent=2) + "\n")
        rows.append(dict(read_json(path)))
    return rows


def measure_sites(
    weights: dict[str, Path],
    seeds: Sequence[int],
    counts: Sequence[int],
    folder: Path,
    sensor: str,
    progress: Progress = no_progress,
) -> pd.DataFrame:
    """Measure every site with every network; arguments are those of `measure_site`."""
    rows: list[dict[str, Any]] = []
    pairs = [(network, seed) for seed in seeds for network in weights]
    for number, (network, seed) in enumerate(pairs, 1):
        rows += measure_site(network, weights[network], seed, counts, folder, sensor)
        progress(number, len(pairs))
    return pd.DataFrame(rows)


def learning_table(measured: pd.DataFrame) -> Table:
    """Build the learning curve: means over the sites, with intervals of a bootstrap over them."""
    rows = []
    for (network, count), sites in measured.groupby(["network", "count"], sort=False):
        row: dict[str, Any] = {"network": network, "count": count, "sites": len(sites)}
        for name in (BEFORE, AFTER):
            row[f"f1_{name}"] = sites[f"f1_{name}"].mean()
            row[f"answered_{name}"] = sites[f"answered_{name}"].sum() / sites[f"frames_{name}"].sum()
            row[f"wrong_{name}"] = sites[f"wrong_{name}"].sum() / max(1, sites[f"answered_{name}"].sum())
        gain = (sites[f"f1_{AFTER}"] - sites[f"f1_{BEFORE}"]).to_numpy()
        row["gain"] = gain.mean()
        row["gain_low"], row["gain_high"] = _interval(gain)
        row["forgotten"] = (sites["simulated_before"] - sites["simulated_after"]).max()
        rows.append(row)
    columns: tuple[Column, ...] = (
        label_column("network"),
        count_column("count", "labelled frames"),
        count_column("sites"),
        *(
            column
            for name in (BEFORE, AFTER)
            for column in (
                number_column(f"f1_{name}", f"macro F1 {name}", 3),
                number_column(f"answered_{name}", f"answered {name}", 2),
                number_column(f"wrong_{name}", f"wrong of answered {name}", 3),
            )
        ),
        number_column("gain", "gain of F1", 3),
        interval_column("gain", "95 %", 3),
        number_column("forgotten", "most lost on simulated doors", 3),
    )
    note = (
        "Frames of three doors of each simulated building were labelled, those of its other three doors tested. "
        "An abstention counts as an error of recall. Intervals: bootstrap over the sites."
    )
    return Table.from_frame("Adapted to a site", pd.DataFrame(rows), columns, note)


def _interval(values: np.ndarray) -> tuple[float, float]:
    """Return the percentile bootstrap interval of 95 % of a mean; NaN for fewer than five values."""
    if len(values) < 5:
        return float("nan"), float("nan")
    rng = np.random.default_rng(0)
    means = rng.choice(values, (_RESAMPLES, len(values))).mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)
