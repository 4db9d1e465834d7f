# SPDX-License-Identifier: Apache-2.0
"""Predictions for clouds with ghost points: the file they are kept in, and their tables."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from doorstate.evaluation.table import Table
from doorstate.types import ABSTAINED, STATES


class GhostResult(NamedTuple):
    """State that one method predicted for one cloud."""

    method: str
    cloud: str  # "image" or "flat"
    removed: bool  # outliers, before the method
    share: float  # of the pixels that are ghosts
    side_px: int
    towards: str
    door: int
    state: str
    predicted: str  # or ABSTAINED


def read_results(path: Path) -> list[GhostResult]:
    """Return the results of an earlier run; none without a file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [
            GhostResult(
                method,
                cloud,
                removed == "True",
                float(share),
                int(side_px),
                towards,
                int(door),
                state,
                predicted,
            )
            for method, cloud, removed, share, side_px, towards, door, state, predicted in csv.reader(file)
        ]


def append_results(path: Path, results: Sequence[GhostResult]) -> None:
    """Append the results of one door to a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(results)


def to_frame(results: Sequence[GhostResult]) -> pd.DataFrame:
    """Return one row per result, with the prediction for the same cloud without ghosts."""
    frame = pd.DataFrame(results, columns=list(GhostResult._fields))
    keys = ["method", "cloud", "removed", "door"]
    without = frame.loc[frame["share"] == 0, [*keys, "predicted"]].rename(columns={"predicted": "without"})
    return frame.merge(without, on=keys)


def method_table(results: Sequence[GhostResult]) -> Table:
    """Return one row per method, form of cloud, and share of ghosts: all sizes and sides together."""
    rows: list[tuple[str, ...]] = []
    frame = to_frame(results)
    keys = ["method", "cloud", "removed", "share"]
    for (method, cloud, removed, share), group in frame.groupby(keys, sort=False):
        closed, others = group[group["state"] == "closed"], group[group["state"] != "closed"]
        is_open = closed["predicted"] == "open"
        rows.append(
            (
                str(method),
                str(cloud),
                "removed" if removed else "kept",
                f"{share:.1%}",
                str(len(closed)),
                *(
                    _share(closed["predicted"] == value)
                    for value in ("closed", ABSTAINED, "semi_open", "open")
                ),
                str((is_open & (closed["without"] != "open")).sum()),
                str(len(others)),
                _share(others["predicted"] == others["state"]),
                _share(others["predicted"] == ABSTAINED),
            )
        )
    return Table(
        "Ghost points: methods",
        (
            "method",
            "cloud",
            "ghosts are",
            "ghosts",
            "closed doors: clouds",
            "closed",
            "abstained",
            "semi-open",
            "open",
            "become open",
            "others: clouds",
            "right",
            "abstained",
        ),
        tuple(sorted(rows, key=lambda row: row[:3])),
        "Shares of the predictions for closed doors, and for semi-open and open ones (others). *Become open*: number "
        "of predictions *open* for closed doors that are not *open* without ghosts. Half of the doors are without "
        "noise, half are seen by the sensor `xtion`. Ghosts are squares of 1, 2, 3 and 5 pixels a side, before, "
        "behind, and on both sides of the surface: all of them for the network, one side for each size and "
        "door for rules.",
        text_columns=4,
    )


def size_table(results: Sequence[GhostResult], method: str) -> Table:
    """Return one row per share, size and side of the ghosts: images of closed doors, for one method."""
    frame = to_frame(results)
    frame = frame[(frame["method"] == method) & (frame["state"] == "closed") & (frame["share"] > 0)]
    frame = frame[frame["cloud"] == "image"]
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


def _share(mask: pd.Series) -> str:
    return f"{mask.mean():.0%}" if len(mask) else "–"
