# SPDX-License-Identifier: Apache-2.0
"""Speed of the networks. The forms of a network alternate, so that their ratios hold on a machine with other load."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import NamedTuple

import torch

from benchmarks.clouds import Clouds
from benchmarks.forms import BASELINES, Form, forms_of
from benchmarks.measured_network import MeasuredNetwork, NetworkTask, OperationCount
from benchmarks.networks_table import networks_table
from benchmarks.store import Result, Store
from benchmarks.timing import MatrixSpeed
from benchmarks.workers import Worker
from doorstate._devices import has_fast_bf16
from doorstate._jobs import Progress
from doorstate.errors import RunError
from doorstate.evaluation.table import Table

INFERENCE_BATCHES = (1, 16)
Round = dict[str, float]
"""`training_ms`, `inference_1_ms` and `inference_16_ms` per cloud, and `peak_gflops` of the machine in this round."""


class Plan(NamedTuple):
    """Settings of all measurements."""

    batch: int
    repeats: int
    threads: int
    checkouts: dict[str, Path]  # of ports, by network
    pyg: bool
    same_allocator: bool
    compiled: bool = False
    device: str = "cpu"

    def forms(self, network: str) -> list[Form]:
        """Return the forms of a network."""
        return forms_of(network, network in self.checkouts, self.pyg, self.compiled, self.device)


def measure_networks(
    plan: Plan,
    pairs: Sequence[tuple[str, int]],
    load_clouds: Callable[[], Clouds],
    store: Store,
    progress: Progress,
) -> None:
    """Measure networks at numbers of points, and save after each; stored results without failures are kept.

    Args:
        plan: settings.
        pairs: network and number of points.
        load_clouds: called if something is to be measured.
        store: results.
        progress: called with measured and all rounds of forms.
    """
    missing = [pair for pair in pairs if not _is_complete(store.results.get(_key(*pair)))]
    if not missing:
        store.save(table_of(store, pairs, plan))
        return
    clouds, done = load_clouds(), 0
    total = sum(plan.repeats * len(plan.forms(network)) for network, _ in missing)
    progress(done, total)

    def advance() -> None:
        nonlocal done
        done += 1
        progress(done, total)

    with Worker(MatrixSpeed, plan.threads, plan.device) as matrix_speed:
        for network, points in missing:
            store.results[_key(network, points)] = _measure(
                plan, network, clouds.first_points(points), matrix_speed, advance
            )
            store.save(table_of(store, pairs, plan))


def table_of(store: Store, pairs: Sequence[tuple[str, int]], plan: Plan) -> Table:
    """Return the table of these networks, followed by the other stored results."""
    keys = dict.fromkeys([_key(*pair) for pair in pairs] + list(store.results))
    results = [store.results[key] for key in keys if key in store.results]
    return networks_table(results, plan.same_allocator)


def _key(network: str, points: int) -> str:
    return f"{network} {points}"


def _is_complete(result: Result | None) -> bool:
    return result is not None and not any("reason" in row for row in result["rows"])


class _FormRounds:
    """Measurements of one form in its worker; after the first failure it is not measured again."""

    def __init__(self, form: Form, worker: Worker) -> None:
        self.form, self._worker = form, worker
        self.rounds: list[Round] = []
        self.memory_mib = math.nan
        self.threads = 0
        self.failure = ""

    def wait_until_ready(self) -> None:
        """Wait until the worker has imported and built everything."""
        try:
            self.threads = self._worker.call("threads")
        except RunError as error:
            self.failure = str(error)

    def measure_round(self, batch: int, peak_gflops: float) -> None:
        """Measure training, and inference unless neighbours are cached."""
        if self.failure:
            return
        try:
            measured = {"training_ms": self._worker.call("training_seconds") * 1000 / batch}
            self.memory_mib = self._worker.call("memory_mib")
            if not (self.form.cached or self.form.compiled):  # new clouds have no cached neighbours
                for clouds in INFERENCE_BATCHES:
                    seconds = self._worker.call("inference_seconds", clouds)
                    measured[f"inference_{clouds}_ms"] = seconds * 1000 / clouds
            self.rounds.append(measured | {"peak_gflops": peak_gflops})
        except RunError as error:
            self.failure = str(error)


def _measure(
    plan: Plan, network: str, clouds: Clouds, matrix_speed: Worker, advance: Callable[[], None]
) -> Result:
    with Worker(OperationCount, network, clouds) as counter:
        gflop = counter.call("training_gflop")
    precisions = (False, True) if has_fast_bf16(torch.device(plan.device)) else (False,)
    with ExitStack() as stack:
        measured_forms = [
            _FormRounds(
                form, stack.enter_context(Worker(MeasuredNetwork, _task(plan, network, form, clouds)))
            )
            for form in plan.forms(network)
        ]
        # Imports in other workers would take processor time from the measurement.
        for measured in measured_forms:
            measured.wait_until_ready()
        for _ in range(plan.repeats):
            peaks = {bf16: matrix_speed.call("gflops", bf16) for bf16 in precisions}
            for measured in measured_forms:
                measured.measure_round(plan.batch, peaks[measured.form.bf16])
                advance()
    return {
        "network": network,
        "points": clouds.points.shape[1],
        "training_gflop_per_cloud": gflop,
        "rows": [_row(measured, measured_forms, gflop) for measured in measured_forms],
    }


def _task(plan: Plan, network: str, form: Form, clouds: Clouds) -> NetworkTask:
    checkout = plan.checkouts.get(network)
    return NetworkTask(
        network, form, clouds, plan.batch, plan.threads, checkout, plan.same_allocator, plan.device
    )


def _row(measured: _FormRounds, all_forms: Sequence[_FormRounds], gflop: float) -> Result:
    if measured.failure:
        return {"form": measured.form.name, "reason": measured.failure}
    rounds = measured.rounds
    gflops = [gflop / (values["training_ms"] / 1000) for values in rounds]
    shares = [rate / values["peak_gflops"] for rate, values in zip(gflops, rounds, strict=True)]
    return {
        "form": measured.form.name,
        "threads": measured.threads,
        "rounds": rounds,
        **{name: median(values[name] for values in rounds) for name in rounds[0]},
        "memory_mib": measured.memory_mib,
        "training_gflops": median(gflops),
        "share_of_peak": median(shares),
        "speedups": {
            baseline.form.name: _speedups(rounds, baseline.rounds)
            for baseline in all_forms
            if baseline.form in BASELINES and baseline is not measured and not baseline.failure
        },
    }


def _speedups(rounds: list[Round], baseline_rounds: list[Round]) -> dict[str, float]:
    """Return the time of the baseline divided by that of the form, as the median over rounds."""
    names = [name for name in rounds[0] if name.endswith("_ms")]
    return {
        name.removesuffix("_ms"): median(
            baseline[name] / values[name] for values, baseline in zip(rounds, baseline_rounds, strict=True)
        )
        for name in names
    }
