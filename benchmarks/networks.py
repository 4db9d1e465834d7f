# SPDX-License-Identifier: Apache-2.0
"""Speed of the networks; the forms of one take turns, so that their ratios hold on a noisy machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.clouds import Clouds
from benchmarks.forms import BASELINES, Form, forms_of
from benchmarks.store import Group, Store
from benchmarks.subjects import OperationCount, Subject, Task
from benchmarks.tables import networks_table
from benchmarks.timing import MatrixPeak
from benchmarks.workers import Worker
from doorstate._jobs import Progress
from doorstate.errors import RunError
from doorstate.evaluation.table import Table
from doorstate.training.environment import has_fast_bf16

INFERENCE_BATCHES = (1, 16)
Round = dict[str, float]  # train_ms, infer_1_ms, infer_16_ms per cloud, and peak_gflops of the round


class Plan(NamedTuple):
    """How everything is measured."""

    batch: int
    repeats: int
    threads: int
    checkouts: dict[str, Path]
    pyg: bool
    same_allocator: bool
    compiled: bool = False

    def forms(self, network: str) -> list[Form]:
        """Forms of a network under this plan."""
        return forms_of(network, network in self.checkouts, self.pyg, self.compiled)


def run(
    plan: Plan,
    wanted: Sequence[tuple[str, int]],
    draw: Callable[[], Clouds],
    store: Store,
    progress: Progress,
) -> None:
    """Measure what the store does not hold yet, network by network and number by number of points.

    A group with a row that failed is measured again.
    """
    missing = [pair for pair in wanted if not _finished(store.groups.get(_key(*pair)))]
    if not missing:
        store.save(table_of(store, wanted, plan))
        return
    clouds, done = draw(), 0
    total = sum(plan.repeats * len(plan.forms(network)) for network, _ in missing)
    progress(done, total)

    def tick() -> None:
        nonlocal done
        done += 1
        progress(done, total)

    with Worker(MatrixPeak, plan.threads) as peak:
        for network, points in missing:
            store.groups[_key(network, points)] = _measure(plan, network, clouds.cut(points), peak, tick)
            store.save(table_of(store, wanted, plan))


def _key(network: str, points: int) -> str:
    return f"{network} {points}"


def _finished(group: Group | None) -> bool:
    return group is not None and not any("reason" in row for row in group["rows"])


def table_of(store: Store, wanted: Sequence[tuple[str, int]], plan: Plan) -> Table:
    """Groups asked for now, in that order, and then what was measured before."""
    keys = dict.fromkeys([_key(*pair) for pair in wanted] + list(store.groups))
    groups = [store.groups[key] for key in keys if key in store.groups]
    return networks_table(groups, plan.same_allocator)


class _Contestant:
    """One form in its worker, and what was measured of it; after its first failure it takes no more turns."""

    def __init__(self, form: Form, worker: Worker) -> None:
        self.form, self._worker = form, worker
        self.rounds: list[Round] = []
        self.memory_mib = math.nan
        self.threads = 0
        self.reason = ""

    def get_ready(self) -> None:
        """Wait until its worker has imported and built everything."""
        try:
            self.threads = self._worker.call("threads")
        except RunError as error:
            self.reason = str(error)

    def take_turn(self, batch: int, peak_gflops: float) -> None:
        """One round: a sample of training, and of inference unless neighbours are given."""
        if self.reason:
            return
        try:
            found = {"train_ms": self._worker.call("train_s") * 1000 / batch}
            self.memory_mib = self._worker.call("memory_mib")
            if not (self.form.cached or self.form.compiled):  # a new cloud's neighbours are not known
                for clouds in INFERENCE_BATCHES:
                    found[f"infer_{clouds}_ms"] = self._worker.call("infer_s", clouds) * 1000 / clouds
            self.rounds.append(found | {"peak_gflops": peak_gflops})
        except RunError as error:
            self.reason = str(error)


def _measure(plan: Plan, network: str, clouds: Clouds, peak: Worker, tick: Callable[[], None]) -> Group:
    with Worker(OperationCount, network, clouds) as counter:
        gflop = counter.call("training_gflop")
    precisions = (False, True) if has_fast_bf16() else (False,)
    with ExitStack() as stack:
        contestants = [
            _Contestant(form, stack.enter_context(Worker(Subject, _task(plan, network, form, clouds))))
            for form in plan.forms(network)
        ]
        # Workers that still import would take the processor from what is timed.
        for contestant in contestants:
            contestant.get_ready()
        for _ in range(plan.repeats):
            peaks = {bf16: peak.call("gflops", bf16) for bf16 in precisions}
            for contestant in contestants:
                contestant.take_turn(plan.batch, peaks[contestant.form.bf16])
                tick()
    return {
        "network": network,
        "points": clouds.points.shape[1],
        "training_gflop_per_cloud": gflop,
        "rows": [_row(contestant, contestants, gflop) for contestant in contestants],
    }


def _task(plan: Plan, network: str, form: Form, clouds: Clouds) -> Task:
    checkout = plan.checkouts.get(network)
    return Task(network, form, clouds, plan.batch, plan.threads, checkout, plan.same_allocator)


def _row(contestant: _Contestant, contestants: Sequence[_Contestant], gflop: float) -> dict[str, Any]:
    if contestant.reason:
        return {"form": contestant.form.name, "reason": contestant.reason}
    own = contestant.rounds
    reached = [gflop / (one["train_ms"] / 1000) for one in own]
    return {
        "form": contestant.form.name,
        "threads": contestant.threads,
        "rounds": own,
        **{name: median(one[name] for one in own) for name in own[0]},
        "memory_mib": contestant.memory_mib,
        "train_gflops": median(reached),
        "share_of_peak": median(rate / one["peak_gflops"] for rate, one in zip(reached, own, strict=True)),
        "speedups": {
            other.form.name: _speedups(own, other.rounds)
            for other in contestants
            if other.form in BASELINES and other is not contestant and not other.reason
        },
    }


def _speedups(own: list[Round], baseline: list[Round]) -> dict[str, float]:
    """How many times the baseline's time of the same round, median over the rounds."""
    names = [name for name in own[0] if name.endswith("_ms")]
    return {
        name.removesuffix("_ms"): median(
            theirs[name] / ours[name] for ours, theirs in zip(own, baseline, strict=True)
        )
        for name in names
    }
