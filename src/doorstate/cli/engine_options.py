# SPDX-License-Identifier: Apache-2.0
"""Options of where the pieces of a command run, and of what each of them gets."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from doorstate.cli.choices import ENGINE
from doorstate.cli.options import Device
from doorstate.cli.shared_options import with_shared_options
from doorstate.errors import ConfigError

if TYPE_CHECKING:
    from doorstate._jobs import Engine, Resources

_EngineName = Annotated[
    str,
    typer.Option(
        "--engine",
        parser=ENGINE,
        metavar="NAME",
        help="Where the work runs: {engines}. ray is this machine, or a cluster with a shared folder.",
    ),
]
_Address = Annotated[
    str | None,
    typer.Option(
        help="Running cluster of --engine ray: auto or HOST:PORT. [default: RAY_ADDRESS, or this machine alone]"
    ),
]
_Workers = Annotated[
    int | None,
    typer.Option(
        help="Worker processes. [default: one a processor; in evaluate and report without --engine ray, this one]",
        min=1,
    ),
]
Gpus = Annotated[
    float | None,
    typer.Option(help="GPUs of each run, or of each worker of evaluate; 0.25 lets four share one.", min=0),
]


class EngineOptions(NamedTuple):
    """Engine that a user asks for."""

    name: str
    address: str | None
    workers: int | None
    resources: Resources | None = None  # of each piece
    device: str = "cpu"  # of the networks of a piece

    @property
    def is_default(self) -> bool:
        """True if the user asks for no engine: a command may then work in its own process."""
        return self.name == "processes" and self.workers is None and self.resources is None

    @property
    def is_cluster(self) -> bool:
        """True if other machines may take part."""
        return self.name == "ray" and bool(self.address or os.environ.get("RAY_ADDRESS"))

    def on_device(self, device: str, resources: Resources | None) -> EngineOptions:
        """Return the engine for networks on a device.

        Raises:
            ConfigError: Ray would hide the device.
        """
        if self.name == "ray" and device.startswith("cuda") and not (resources and resources.gpus):
            raise ConfigError(
                "the engine ray hides GPUs from work that asks for none",
                field="device",
                suggestions={"gpus": 1},
            )
        return self._replace(resources=resources, device=device)

    @contextmanager
    def open(self) -> Iterator[Engine]:
        """Start the engine, and end it after the block.

        Raises:
            ConfigError: there is no cluster at the address.
            MissingExtraError: Ray is not installed.
        """
        from doorstate._jobs import ProcessEngine, RayEngine
        from doorstate.cli.progress import working

        if self.name == "processes":
            yield ProcessEngine(self.workers)
            return
        engine = RayEngine(self.address, self.workers)
        with working("Starting Ray"):
            engine.__enter__()
        try:
            yield engine
        finally:
            engine.close()


def engine_options(
    workers: _Workers = None, engine: _EngineName = "processes", address: _Address = None
) -> EngineOptions:
    """Return the engine of a command whose pieces take one processor each.

    Raises:
        ConfigError: an address of no cluster.
    """
    if engine == "processes" and address is not None:
        raise ConfigError(
            "the engine processes has no address", field="address", hint="choose the engine ray"
        )
    return EngineOptions(engine, address, workers)


def runs_options(
    jobs: Annotated[
        int | None,
        typer.Option(
            help="Number of runs at the same time."
            " [default: 1; with --engine ray, --cpus, --gpus or --memory-gib, as many as fit]",
            min=1,
        ),
    ] = None,
    cpus: Annotated[
        int | None,
        typer.Option(
            help="Processors, and so threads, of each run."
            " [default: an equal share; with --engine ray, --gpus or --memory-gib, 1]",
            min=1,
        ),
    ] = None,
    gpus: Gpus = None,
    memory_gib: Annotated[
        float | None, typer.Option(help="Main memory of each run in GiB. [default: not counted]", min=0)
    ] = None,
    device: Device = "auto",
    engine: _EngineName = "processes",
    address: _Address = None,
) -> EngineOptions:
    """Return the engine of a command that trains, and resources and device of each run.

    Raises:
        ConfigError: an address of no cluster, impossible resources, or a device that Ray would hide.
    """
    from doorstate._jobs import Resources

    resources = None
    if cpus is not None or gpus is not None or memory_gib is not None:
        resources = Resources(cpus or 1, gpus or 0.0, int((memory_gib or 0) * 2**30))
    elif engine == "processes":
        jobs = jobs or 1
    return engine_options(jobs, engine, address).on_device(device, resources)


with_engine_options = with_shared_options(engine_options, "engine")
with_runs_options = with_shared_options(runs_options, "runs")
