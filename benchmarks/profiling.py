# SPDX-License-Identifier: Apache-2.0
"""Where the time of a training step and of an inference goes, by groups of operators."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

from benchmarks.clouds import Clouds
from benchmarks.forms import PLAIN, Form
from benchmarks.store import Group
from benchmarks.subjects import Subject, Task
from benchmarks.tables import milliseconds
from benchmarks.workers import Worker
from doorstate._jobs import Progress
from doorstate.evaluation.table import UNDEFINED, Table
from doorstate.training.environment import has_fast_bf16

# An operator belongs to the first group that has a part of its name; `_Name` is an autograd function of our own.
GROUPS: dict[str, tuple[str, ...]] = {
    "optimiser": ("Optimizer", "_foreach", "_fused_adam", "addcdiv", "lerp", "aten::sqrt"),
    "matrix products": ("mm", "matmul", "linear", "conv", "einsum", "mkldnn", "onednn", "aten::dot"),
    "batch norm": ("batch_norm", "BatchNorm", "aten::var", "rsqrt", "Moment"),
    "activations": (
        "relu",
        "elu",
        "threshold",
        "sigmoid",
        "tanh",
        "softmax",
        "dropout",
        "bernoulli",
        "nll_loss",
    ),
    "neighbour search": ("topk", "cdist", "sort", "kthvalue", "aten::lt", "aten::le", "nonzero", "bitwise"),
    "gathers and scatters": ("index", "gather", "scatter", "embedding", "Neighbour", "Gather"),
    "pooling": ("max", "amin", "aten::mean", "MeanBackward", "Max", "Winner"),
    "copies": ("copy", "clone", "contiguous", "aten::cat", "stack", "zero", "fill", "empty", "aten::to"),
    "arithmetic": (
        "add",
        "sub",
        "mul",
        "div",
        "sum",
        "square",
        "pow",
        "neg",
        "where",
        "abs",
        "clamp",
        "sign",
    ),
}
OTHER = "other"
_NOTHING: dict[str, Any] = {"ms": 0.0, "operators": []}
_SHOWN = 3
_LEAST_SHARE = 0.005
_ENGINE = "autograd::engine::evaluate_function: "
_NOTE = (
    "Self time on the CPU by torch's profiler, which itself slows small operators down: read shares, not "
    "totals. Training is one step with AdamW on a batch of {batch}, inference one cloud; milliseconds are "
    "per step and share of it."
)


def group_of(operator: str) -> str:
    """Group of an operator by its name."""
    return next((name for name, parts in GROUPS.items() if any(part in operator for part in parts)), OTHER)


def profiled_forms(which: str) -> list[Form]:
    """The plain form, the fast form as it trains here, or both, in the order before and after."""
    bf16 = has_fast_bf16()
    fast = Form("fast bf16" if bf16 else "fast fp32", "fast", bf16)
    return {"plain": [PLAIN], "fast": [fast], "both": [PLAIN, fast]}[which]


def measure(
    networks: Sequence[str],
    forms: Sequence[Form],
    clouds: Clouds,
    batch: int,
    threads: int,
    progress: Progress,
) -> list[Group]:
    """Time per group of operators, and its longest operators, of every network, form and phase."""
    os.environ["KINETO_LOG_LEVEL"] = "99"  # workers would tell of every profile on standard error
    rows: list[Group] = []
    pairs = [(network, form) for network in networks for form in forms]
    for done, (network, form) in enumerate(pairs):
        progress(done, len(pairs))
        with Worker(Subject, Task(network, form, clouds, batch, threads)) as worker:
            for phase in ("training", "inference"):
                operators = worker.call("profile", phase == "training")
                about = {"network": network, "form": form.name, "phase": phase}
                rows.append(about | {"groups": _grouped(operators)})
    progress(len(pairs), len(pairs))
    return rows


def profile_table(rows: Sequence[Group], batch: int) -> Table:
    """Groups down, the longest of the first form first; one column per form."""
    forms = list(dict.fromkeys(row["form"] for row in rows))
    by_kind: dict[tuple[str, str], dict[str, dict[str, Any]]] = defaultdict(dict)
    for row in rows:
        by_kind[row["network"], row["phase"]][row["form"]] = row["groups"]
    cells = []
    for (network, phase), found in by_kind.items():
        totals = {form: sum(group["ms"] for group in found[form].values()) for form in forms}
        cells.append((network, phase, "all", *(f"{milliseconds(totals[form])} ms" for form in forms), ""))
        names = sorted(
            {name for groups in found.values() for name in groups}, key=lambda n: -_ms(found, forms, n)
        )
        for name in names:
            if all(found[form].get(name, _NOTHING)["ms"] < _LEAST_SHARE * totals[form] for form in forms):
                continue
            times = (_share(found[form].get(name), totals[form]) for form in forms)
            longest = found[forms[-1]].get(name, _NOTHING)["operators"]
            cells.append((network, phase, name, *times, ", ".join(longest)))
    columns = ("network", "phase", "group", *forms, f"longest, {forms[-1]}")
    return Table("Where the time goes", columns, tuple(cells), _NOTE.format(batch=batch), text_columns=3)


def _grouped(operators: Sequence[tuple[str, float]]) -> dict[str, dict[str, Any]]:
    groups: dict[str, dict[str, Any]] = defaultdict(lambda: {"ms": 0.0, "operators": []})
    for name, spent_ms in operators:
        group = groups[group_of(name)]
        group["ms"] += spent_ms
        if len(group["operators"]) < _SHOWN:
            group["operators"].append(name.removeprefix(_ENGINE).rpartition("::")[2])
    return dict(groups)


def _ms(found: dict[str, Any], forms: Sequence[str], name: str) -> float:
    return max(float(found[form].get(name, _NOTHING)["ms"]) for form in forms)


def _share(group: dict[str, Any] | None, total_ms: float) -> str:
    if group is None:
        return UNDEFINED
    return f"{milliseconds(group['ms'])} ms, {100 * group['ms'] / total_ms:.0f} %"
