# SPDX-License-Identifier: Apache-2.0
"""Options of engines: resources and device of each piece, and what excludes each other."""

from __future__ import annotations

import pytest

from doorstate._jobs import Resources
from doorstate.cli.engine_options import engine_options, runs_options
from doorstate.errors import ConfigError
from tests.cli.helpers import Run, check_error


def test_the_default_is_one_run_in_this_process() -> None:
    runs = runs_options()
    assert (runs.name, runs.workers, runs.resources, runs.device) == ("processes", 1, None, "auto")
    assert not runs.is_default
    assert engine_options().is_default
    assert not engine_options(workers=2).is_default
    assert not engine_options(engine="ray").is_default


def test_runs_have_the_resources_that_are_asked_for() -> None:
    runs = runs_options(gpus=0.25, memory_gib=2, device="cuda", engine="ray")
    assert runs.resources == Resources(cpus=1, gpus=0.25, memory_bytes=2**31)
    assert (runs.workers, runs.device) == (None, "cuda")


@pytest.mark.parametrize("device", ["cuda", "cuda:1"])
def test_ray_needs_gpus_for_a_device(device: str) -> None:
    with pytest.raises(ConfigError) as refused:
        runs_options(cpus=2, device=device, engine="ray")
    assert (refused.value.field, refused.value.suggestions) == ("device", {"gpus": 1})
    assert runs_options(device=device).device == device
    for unhidden in ("cpu", "auto"):
        assert runs_options(device=unhidden, engine="ray").device == unhidden


def test_an_address_is_that_of_a_cluster() -> None:
    with pytest.raises(ConfigError) as refused:
        engine_options(address="auto")
    assert refused.value.field == "address"


@pytest.mark.parametrize(
    "command",
    [("compare", "--data", "data"), ("resolution", "a.toml"), ("transfer", "a.toml"), ("evaluate", "data")],
)
def test_commands_say_what_to_ask_for(command: tuple[str, ...], run: Run) -> None:
    check_error(run(*command, "--device", "cuda", "--engine", "ray"), 2, "--device", "--gpus 1")
