# SPDX-License-Identifier: Apache-2.0
"""Resources of pieces, and how many of them fit."""

from __future__ import annotations

import pytest

from doorstate._jobs import ProcessEngine, Resources
from doorstate.errors import ConfigError


@pytest.mark.parametrize(
    ("cpus", "gpus", "memory_gib", "count"),
    [
        (1, 0, 0, 8),
        (2, 0, 0, 4),
        (3, 0, 0, 2),
        (1, 0.5, 0, 4),
        (1, 0.3, 0, 6),
        (1, 1, 0, 2),
        (1, 2, 0, 1),
        (1, 0, 5, 3),
        (9, 0, 0, 0),
        (1, 3, 0, 0),
        (1, 0, 17, 0),
    ],
)
def test_pieces_are_counted_by_the_scarcest_resource(
    cpus: int, gpus: float, memory_gib: int, count: int
) -> None:
    asked = Resources(cpus, gpus, memory_gib * 2**30)
    assert asked.times_in(8, 2, 16 * 2**30) == count


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"cpus": 0}, "cpus"),
        ({"gpus": -1}, "gpus"),
        ({"gpus": 1.5}, "gpus"),
        ({"memory_bytes": -1}, "memory_bytes"),
    ],
)
def test_impossible_resources_are_refused(arguments: dict[str, float], field: str) -> None:
    with pytest.raises(ConfigError) as caught:
        Resources(**arguments)  # type: ignore[arg-type]
    assert caught.value.field == field


def test_processes_do_not_exceed_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("doorstate._jobs.resources.default_workers", lambda: 2)
    monkeypatch.setattr("doorstate._jobs.processes.default_workers", lambda: 2)
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    assert ProcessEngine().at_once(None) == 2
    assert ProcessEngine(4).at_once(None) == 4, "a number is taken as it is where nothing is asked for"
    assert [ProcessEngine(4).at_once(Resources(cpus)) for cpus in (1, 2)] == [2, 1]
    assert [ProcessEngine(jobs).threads(None) for jobs in (1, 2, 4)] == [None, 1, 1]
    assert ProcessEngine(1).threads(Resources(2)) == 2
    with pytest.raises(ConfigError):
        ProcessEngine().at_once(Resources(3))
    with pytest.raises(ConfigError):
        ProcessEngine().at_once(Resources(gpus=0.1))
