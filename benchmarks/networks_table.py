# SPDX-License-Identifier: Apache-2.0
"""Table of the speed of the networks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from benchmarks.store import Result
from benchmarks.timing import format_ms
from doorstate.evaluation.table import UNDEFINED, Table, number

_NOTE = (
    "ms per cloud, median of the rounds (lowest–highest). Training is one step: loss, gradients, AdamW. "
    "In a round the forms of a network alternate, each in a process of its own; × is the median over rounds of the "
    "baseline's time divided by the form's, for training / inference of one cloud. MiB is the growth of memory in the "
    "first training steps. *GFLOP/s* counts two operations per multiply-add in the forward pass of the plain form, "
    "times three, without the search for neighbours. Fast forms do fewer operations, so their rate may exceed the "
    "peak. *Peak* is the fastest product of two 2048 × 2048 matrices in the same round, in bf16 for bf16 forms. "
    "*Neighbours cached*: the neighbours of coordinates are searched before the measurement; new clouds have none, so "
    "there is no inference. "
)
_OWN_ALLOCATOR = (
    "Fast forms keep freed memory, as `doorstate train` does; the plain form, ports and PyTorch Geometric run "
    "without."
)
_SAME_ALLOCATOR = "All forms keep freed memory, as `doorstate train` does (`--same-allocator`)."
_COLUMNS = (
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


def networks_table(results: Sequence[Result], same_allocator: bool = False) -> Table:
    """Return one row per network, number of points and form; failures are listed in the note."""
    baselines = [
        name
        for name in ("plain fp32", "port", "pyg")
        if any(name in row.get("speedups", {}) for result in results for row in result["rows"])
    ]
    rows = [
        (result["network"], str(result["points"]), row["form"], *_cells(row, baselines))
        for result in results
        for row in result["rows"]
    ]
    note = _NOTE + (_SAME_ALLOCATOR if same_allocator else _OWN_ALLOCATOR)
    return Table(
        "Speed of the networks",
        (*_COLUMNS, *(f"× {name}" for name in baselines)),
        tuple(rows),
        "\n\n".join([note, *list_failures(results)]),
        text_columns=3,
    )


def list_failures(results: Iterable[Result]) -> list[str]:
    """Return one line per form that could not be measured."""
    return [
        f"{result['network']} at {result['points']} points, {row['form']}: {row['reason']}"
        for result in results
        for row in result["rows"]
        if "reason" in row
    ]


def _cells(row: Result, baselines: Sequence[str]) -> tuple[str, ...]:
    if "reason" in row:
        return ("failed", *[UNDEFINED] * (5 + len(baselines)))
    return (
        *(_spread(row, name) for name in ("training_ms", "inference_1_ms", "inference_16_ms")),
        number(row["memory_mib"], 0),
        number(row["training_gflops"], 0 if row["training_gflops"] >= 10 else 1),
        f"{100 * row['share_of_peak']:.0f} %",
        *(_ratio(row["speedups"].get(name)) for name in baselines),
    )


def _spread(row: Result, name: str) -> str:
    if name not in row:
        return UNDEFINED
    values = [values[name] for values in row["rounds"]]
    if len(values) == 1:
        return format_ms(row[name])
    return f"{format_ms(row[name])} ({format_ms(min(values))}–{format_ms(max(values))})"


def _ratio(speedup: dict[str, float] | None) -> str:
    if speedup is None:
        return UNDEFINED
    return f"{speedup['training']:.1f} / {number(speedup.get('inference_1', math.nan), 1)}"
