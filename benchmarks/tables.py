# SPDX-License-Identifier: Apache-2.0
"""Results as tables for people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from benchmarks.store import Group
from doorstate.evaluation.table import UNDEFINED, Table, number

_NETWORKS_NOTE = (
    "ms per cloud, median of the rounds (lowest–highest). Training is one step: loss, gradients, AdamW. "
    "Within a round the forms of a network take turns, each alone and in its own process; × is the median "
    "of the rounds' ratios, of training / of inference of one cloud. MiB is how far the process grew in "
    "its first training steps. *GFLOP/s* counts two operations per multiply-add of the plain form's "
    "forward pass, times three, without the search for neighbours. Re-arranged forms do fewer operations "
    "than that, so theirs is a rate of useful plain operations and may exceed the peak. *Peak* is the "
    "quickest product of two 2048 × 2048 matrices in the same round, in bf16 for bf16 forms. *Neighbours "
    "cached* are those of coordinates, found before the clock starts; a new cloud has none, hence no "
    "inference. "
)
_OWN_ALLOCATOR = (
    "Fast forms keep freed memory, as `doorstate train` does; the plain form, ports and PyTorch Geometric "
    "run as their users run them, without."
)
_SAME_ALLOCATOR = "All forms keep freed memory, as `doorstate train` does (`--same-allocator`)."


def networks_table(groups: Sequence[Group], same_allocator: bool = False) -> Table:
    """One row per network, number of points and form; a form that failed says why."""
    baselines = [
        name
        for name in ("plain fp32", "port", "pyg")
        if any(name in row.get("speedups", {}) for group in groups for row in group["rows"])
    ]
    columns = (
        "network",
        "points",
        "form",
        "training",
        "inference",
        "batch of 16",
        "MiB",
        "GFLOP/s",
        "of peak",
    )
    rows = [
        (group["network"], str(group["points"]), row["form"], *_cells(row, baselines))
        for group in groups
        for row in group["rows"]
    ]
    note = _NETWORKS_NOTE + (_SAME_ALLOCATOR if same_allocator else _OWN_ALLOCATOR)
    note = "\n\n".join([note, *failures(groups)])
    return Table(
        "Speed of the networks",
        (*columns, *(f"× {name}" for name in baselines)),
        tuple(rows),
        note,
        text_columns=3,
    )


def failures(groups: Iterable[Group]) -> list[str]:
    """One line for every form that could not be measured."""
    return [
        f"{group['network']} at {group['points']} points, {row['form']}: {row['reason']}"
        for group in groups
        for row in group["rows"]
        if "reason" in row
    ]


def _cells(row: dict[str, Any], baselines: Sequence[str]) -> tuple[str, ...]:
    if "reason" in row:
        return ("failed", *[UNDEFINED] * (5 + len(baselines)))
    return (
        *(_spread(row, name) for name in ("train_ms", "infer_1_ms", "infer_16_ms")),
        number(row["memory_mib"], 0),
        number(row["train_gflops"], 0 if row["train_gflops"] >= 10 else 1),
        f"{100 * row['share_of_peak']:.0f} %",
        *(_ratio(row["speedups"].get(name)) for name in baselines),
    )


def _spread(row: dict[str, Any], name: str) -> str:
    if name not in row:
        return UNDEFINED
    values = [one[name] for one in row["rounds"]]
    if len(values) == 1:
        return milliseconds(row[name])
    return f"{milliseconds(row[name])} ({milliseconds(min(values))}–{milliseconds(max(values))})"


def _ratio(speedup: dict[str, float] | None) -> str:
    if speedup is None:
        return UNDEFINED
    return f"{speedup['train']:.1f} / {number(speedup.get('infer_1', math.nan), 1)}"


def milliseconds(value: float) -> str:
    """Three digits, never more than hundredths."""
    return f"{value:.{2 if value < 10 else 1 if value < 100 else 0}f}"
