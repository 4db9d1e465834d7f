# SPDX-License-Identifier: Apache-2.0
"""Predictions for clouds with ghost points, with and without removal of outliers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from doorstate._jobs import Progress
from doorstate.evaluation.table import Table
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.inference.rule_predictor import RulePredictor
from doorstate.rules import create_rule, list_rules
from doorstate.simulation.frames import Frame
from doorstate.simulation.noise.ghosts import Ghosts, add_ghosts
from doorstate.simulation.row import Row
from doorstate.types import ABSTAINED, STATES, Points

from .frames import reference_frames, scene_frames

SHARES = (0.001, 0.003, 0.01, 0.03)
SIDES_PX = (1, 2, 3, 5)
SENSOR = "xtion"


class GhostResult(NamedTuple):
    """State that one method predicted for one cloud."""

    method: str
    removed: bool  # outliers, before the method
    ghosts: Ghosts
    sample_id: str
    state: str
    predicted: str  # or ABSTAINED


def ghost_conditions() -> list[Ghosts]:
    """Return no ghosts, and every share, size and side."""
    return [
        Ghosts(share=0, side_px=1),
        *(
            Ghosts(share=share, side_px=side_px, towards=towards)
            for share in SHARES
            for side_px in SIDES_PX
            for towards in ("front", "behind", "both")
        ),
    ]


def with_ghosts(frame: Frame, ghosts: Ghosts, rng: np.random.Generator) -> Points:
    """Return the points (H, W, 3) of a frame with ghosts along their rays."""
    depth_m = frame.cut.depth_m
    return frame.points * (add_ghosts(depth_m, ghosts, rng) / depth_m)[..., None]


def measure_ghosts(
    network: str, count: int, progress: Progress, conditions: Sequence[Ghosts] | None = None
) -> list[GhostResult]:
    """Return the predictions of packaged weights and of every rule for simulated doors with every kind of ghosts.

    Half of the doors are without noise, and half are seen by a sensor with noise.
    """
    backend = NetworkPredictor.from_weights(network).backend
    methods: dict[str, dict[bool, Predictor]] = {
        network: {removed: NetworkPredictor(backend, remove_outliers=removed) for removed in (True, False)}
    }
    for name in list_rules():
        rule = create_rule(name)
        methods[name] = {removed: RulePredictor(rule, remove_outliers=removed) for removed in (True, False)}
    results = []
    for number, (row, frame) in enumerate(_frames(count, progress)):
        for condition, ghosts in enumerate(conditions or ghost_conditions()):
            cloud = with_ghosts(frame, ghosts, np.random.default_rng((number, condition)))
            for name, predictors in methods.items():
                results += [
                    GhostResult(name, removed, ghosts, row.sample_id, row.state, predictor(cloud).label)
                    for removed, predictor in predictors.items()
                ]
    return results


def _frames(count: int, progress: Progress) -> Iterator[tuple[Row, Frame]]:
    half = -(-count // 2)
    sources = (
        reference_frames(half, lambda done, _: progress(done, count)),
        scene_frames(count - half, SENSOR, lambda done, _: progress(half + done, count)),
    )
    for source in sources:
        yield from source


def method_table(results: Sequence[GhostResult]) -> Table:
    """Return one row per method and share of ghosts, sizes and sides together."""
    rows: list[tuple[str, ...]] = []
    frame = _frame(results)
    for (method, share), group in frame.groupby(["method", "share"], sort=False):
        cells = [str(method), f"{share:.1%}"]
        for removed in (False, True):
            cells += _counts(group[group["removed"] == removed])
        rows.append(tuple(cells))
    return Table(
        "Ghost points: methods",
        (
            "method",
            "ghosts",
            *(
                f"{column}, {how}"
                for how in ("kept", "removed")
                for column in (
                    "closed: right",
                    "abstained",
                    "semi-open",
                    "open",
                    "become open",
                    "others: right",
                    "abstained",
                )
            ),
        ),
        tuple(rows),
        "Shares of the predictions for closed doors, and for semi-open and open ones (others), with ghosts kept and "
        "removed. *Become open*: number of predictions *open* for closed doors that are not *open* without ghosts. "
        f"Half of the doors are without noise, half are seen by the sensor `{SENSOR}`. Ghosts are squares of "
        f"{', '.join(map(str, SIDES_PX))} pixels a side, before, behind, and on both sides of the surface.",
        text_columns=2,
    )


def size_table(results: Sequence[GhostResult], method: str) -> Table:
    """Return one row per share, size and side of the ghosts: closed doors of one method."""
    frame = _frame(results)
    frame = frame[(frame["method"] == method) & (frame["state"] == "closed") & (frame["share"] > 0)]
    rows: list[tuple[str, ...]] = []
    for (share, side_px, towards), group in frame.groupby(["share", "side_px", "towards"], sort=False):
        kept, removed = (group.loc[group["removed"] == value, "predicted"] for value in (False, True))
        rows.append(
            (
                f"{share:.1%}",
                f"{side_px} x {side_px}",
                str(towards),
                str(len(kept)),
                *(str((kept == state).sum()) for state in (*STATES, ABSTAINED)),
                *(str((removed == state).sum()) for state in (*STATES, ABSTAINED)),
            )
        )
    states = ("closed", "semi-open", "open", "abstained")
    return Table(
        f"Ghost points: closed doors, `{method}`",
        (
            "ghosts",
            "pixels",
            "side",
            "doors",
            *(f"{state}, kept" for state in states),
            *(f"{state}, removed" for state in states),
        ),
        tuple(rows),
        text_columns=3,
    )


def _frame(results: Sequence[GhostResult]) -> pd.DataFrame:
    frame = pd.DataFrame(
        [
            {
                "method": result.method,
                "removed": result.removed,
                "share": result.ghosts.share,
                "side_px": result.ghosts.side_px,
                "towards": result.ghosts.towards,
                "sample_id": result.sample_id,
                "state": result.state,
                "predicted": result.predicted,
            }
            for result in results
        ]
    )
    keys = ["method", "removed", "sample_id"]
    without = frame.loc[frame["share"] == 0, [*keys, "predicted"]].rename(columns={"predicted": "without"})
    return frame.merge(without, on=keys)


def _counts(group: pd.DataFrame) -> list[str]:
    """Return cells on closed doors by prediction, and on other doors that are right and that have no state."""
    is_closed = group["state"] == "closed"
    closed, others = group[is_closed], group[~is_closed]
    return [
        *(
            f"{(closed['predicted'] == value).mean():.0%}"
            for value in ("closed", ABSTAINED, "semi_open", "open")
        ),
        str(((closed["predicted"] == "open") & (closed["without"] != "open")).sum()),
        f"{(others['predicted'] == others['state']).mean():.0%}",
        f"{(others['predicted'] == ABSTAINED).mean():.0%}",
    ]
