# SPDX-License-Identifier: Apache-2.0
"""Time of a training step and of an inference by groups of operators."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

from benchmarks.clouds import Clouds
from benchmarks.forms import PLAIN, Form
from benchmarks.measured_network import MeasuredNetwork, NetworkTask
from benchmarks.store import Result
from benchmarks.timing import format_ms
from benchmarks.workers import Worker
from doorstate._devices import has_fast_bf16
from doorstate._jobs import Progress
from doorstate.evaluation.table import UNDEFINED, Table

# An operator belongs to the first group with a part of its name.
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
_EMPTY_GROUP: dict[str, Any] = {"ms": 0.0, "operators": []}
_LISTED_OPERATORS = 3
_MIN_SHARE = 0.005
_ENGINE = "autograd::engine::evaluate_function: "
_NOTE = (
    "Own time of operators on the CPU by torch's profiler, which slows small operators down: compare shares, not "
    "totals. Training is one step with AdamW on a batch of {batch}, inference one cloud; milliseconds are "
    "per step and share of it."
)


def group_of(operator: str) -> str:
    """Return the group of an operator by its name."""
    return next((name for name, parts in GROUPS.items() if any(part in operator for part in parts)), OTHER)


def profiled_forms(which: str) -> list[Form]:
    """Return the plain form, the fast form in the precision of training on this machine, or both."""
    bf16 = has_fast_bf16()
    fast = Form("fast bf16" if bf16 else "fast fp32", "fast", bf16)
    return {"plain": [PLAIN], "fast": [fast], "both": [PLAIN, fast]}[which]


def measure_profile(
    networks: Sequence[str],
    forms: Sequence[Form],
    clouds: Clouds,
    batch: int,
    threads: int,
    progress: Progress,
) -> list[Result]:
    """Return the time per group of operators, and the longest operators, of every network, form and phase."""
    os.environ["KINETO_LOG_LEVEL"] = "99"  # otherwise workers print a line per profile
    rows: list[Result] = []
    pairs = [(network, form) for network in networks for form in forms]
    for number, (network, form) in enumerate(pairs):
        progress(number, len(pairs))
        with Worker(MeasuredNetwork, NetworkTask(network, form, clouds, batch, threads)) as worker:
            for phase in ("training", "inference"):
                operators = worker.call("profile", phase == "training")
                row: Result = {"network": network, "form": form.name, "phase": phase}
                rows.append(row | {"groups": _group_operators(operators)})
    progress(len(pairs), len(pairs))
    return rows


def profile_table(rows: Sequence[Result], batch: int) -> Table:
    """Return one row per group of operators, longest first, and one column per form."""
    forms = list(dict.fromkeys(row["form"] for row in rows))
    by_phase: dict[tuple[str, str], dict[str, dict[str, Any]]] = defaultdict(dict)
    for row in rows:
        by_phase[row["network"], row["phase"]][row["form"]] = row["groups"]
    cells = []
    for (network, phase), groups_by_form in by_phase.items():
        totals = {form: sum(group["ms"] for group in groups_by_form[form].values()) for form in forms}
        cells.append((network, phase, "all", *(f"{format_ms(totals[form])} ms" for form in forms), ""))
        names = {name for groups in groups_by_form.values() for name in groups}
        for name in sorted(names, key=lambda name: -_longest_ms(groups_by_form, forms, name)):
            groups = [groups_by_form[form].get(name, _EMPTY_GROUP) for form in forms]
            if all(
                group["ms"] < _MIN_SHARE * totals[form] for group, form in zip(groups, forms, strict=True)
            ):
                continue
            times = (_share(groups_by_form[form].get(name), totals[form]) for form in forms)
            cells.append((network, phase, name, *times, ", ".join(groups[-1]["operators"])))
    columns = ("network", "phase", "group", *forms, f"longest, {forms[-1]}")
    return Table(
        "Time by groups of operators", columns, tuple(cells), _NOTE.format(batch=batch), text_columns=3
    )


def _group_operators(operators: Sequence[tuple[str, float]]) -> dict[str, dict[str, Any]]:
    groups: dict[str, dict[str, Any]] = defaultdict(lambda: {"ms": 0.0, "operators": []})
    for name, own_ms in operators:
        group = groups[group_of(name)]
        group["ms"] += own_ms
        if len(group["operators"]) < _LISTED_OPERATORS:
            group["operators"].append(name.removeprefix(_ENGINE).rpartition("::")[2])
    return dict(groups)


def _longest_ms(groups_by_form: dict[str, Any], forms: Sequence[str], name: str) -> float:
    return max(float(groups_by_form[form].get(name, _EMPTY_GROUP)["ms"]) for form in forms)


def _share(group: dict[str, Any] | None, total_ms: float) -> str:
    if group is None:
        return UNDEFINED
    return f"{format_ms(group['ms'])} ms, {100 * group['ms'] / total_ms:.0f} %"
