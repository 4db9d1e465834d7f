# SPDX-License-Identifier: Apache-2.0
"""Pieces as tasks of Ray: on this machine, or on all machines of a cluster that share a folder."""

from __future__ import annotations

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from doorstate import __version__
from doorstate._jobs.pieces import MAX_RETRIES, Work
from doorstate._jobs.ray_task import PieceBatch, run_batch
from doorstate._jobs.resources import Resources, default_workers
from doorstate.errors import ConfigError, RunError, check_extra, summarize_exception

_OBJECT_STORE_BYTES = 100 * 2**20  # pieces and results are small: clouds go through files
_BATCH_S = 0.5  # of short pieces in one task
_MAX_BATCH = 1000
_QUEUED = 64  # tasks beyond two for each place: a cluster that grows by demand sees it
_LOOK_S = 1.0
_WAIT_FOR_NODES_S = 900.0  # a cloud starts machines within this time
_WAIT_FOR_FILE_S = 60.0  # network file systems show files of other machines late
_STOP_S = 5.0


class RayEngine:
    """Tasks of Ray, which runs the pieces of a lost process or machine again.

    All machines need this package in the same version, and the folders under the same paths.

    Args:
        address: `auto` or HOST:PORT of a running cluster; None is that of `RAY_ADDRESS`, or else Ray is started on this
            machine for as long as it is needed.
        workers: pieces at the same time; None is as many as their resources allow.

    Raises:
        ConfigError: the address has another form.
        MissingExtraError: Ray is not installed.
    """

    def __init__(self, address: str | None = None, workers: int | None = None) -> None:
        check_extra("the engine ray", "cluster")
        self.address = address or os.environ.get("RAY_ADDRESS") or "local"
        self.workers = workers
        self._is_owner = False
        if "://" in self.address:
            raise ConfigError(
                f"{self.address!r} is no address of a cluster", field="address", expected="auto or HOST:PORT"
            )

    def __enter__(self) -> Self:
        self._ray()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the cluster, or end the one that was started here; tasks that still run are killed."""
        if self._is_owner:
            import ray

            ray.shutdown()
            self._is_owner = False

    def at_once(self, resources: Resources | None) -> int:
        """Return the number of pieces that run at the same time now; a cluster may grow.

        Raises:
            ConfigError: this machine does not have the resources of one piece.
        """
        fitting = self._fitting(resources or Resources())
        if not fitting and self.address == "local":
            raise ConfigError(f"this machine does not have {resources}")
        return max(1, min(self.workers or fitting, fitting))

    def threads(self, resources: Resources | None) -> int:
        """Return the threads of a piece, one if no resources are given."""
        return (resources or Resources()).cpus

    def run(
        self,
        work: Work,
        missing: Sequence[tuple[Any, Path]],
        finished: Callable[[int], None],
        resources: Resources | None,
    ) -> None:
        """Run the pieces; see `Engine`.

        Raises:
            ConfigError: this machine does not have the resources of one piece.
            RunError: processes of a piece were lost again and again, no machine of the cluster has its resources, or
                machines do not share the folder.
        """
        self.at_once(resources)
        needs = resources or Resources()
        job = _RayJob(self, work, missing, finished, needs)
        try:
            try:
                job.run()
            except Exception:
                job.wait_for_running()
                raise
        except BaseException as error:
            if not isinstance(error, Exception):
                job.kill()
                self.close()
            raise

    def _fitting(self, resources: Resources) -> int:
        """Return the number of pieces that all machines hold at the same time."""
        nodes = [node["Resources"] for node in self._ray().nodes() if node["Alive"]]
        return sum(
            resources.times_in(node.get("CPU", 0), node.get("GPU", 0), node.get("memory", 0))
            for node in nodes
        )

    def _ray(self) -> Any:
        """Return the module, connected.

        Raises:
            ConfigError: there is no cluster at the address.
        """
        # Read when the module is imported, and by all processes that it starts.
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        from unittest.mock import patch  # slow to import

        import ray

        if ray.is_initialized():
            return ray
        started_here = {
            "num_cpus": max(default_workers(), self.workers or 1),
            "include_dashboard": False,
            "object_store_memory": _OBJECT_STORE_BYTES,
        }
        try:
            # Ray would replace the handler of SIGTERM, and print events of the cluster on standard output.
            with patch.object(ray._private.utils, "set_sigterm_handler", lambda handler: None):
                ray.init(
                    self.address,
                    log_to_driver=False,
                    logging_level=logging.CRITICAL,
                    **(started_here if self.address == "local" else {}),
                )
            ray._private.worker._worker_logs_enabled = False
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise ConfigError(
                f"no cluster can be used at {self.address!r} ({summarize_exception(error)})", field="address"
            ) from error
        except BaseException:
            ray.shutdown()
            raise
        self._is_owner = True
        return ray


class _RayJob:
    """Tasks of one call of `RayEngine.run`."""

    def __init__(
        self,
        engine: RayEngine,
        work: Work,
        missing: Sequence[tuple[Any, Path]],
        finished: Callable[[int], None],
        resources: Resources,
    ) -> None:
        self._engine, self._work, self._finished, self._resources = engine, work, finished, resources
        self._ray = engine._ray()
        self._waiting = deque(missing)
        self._running: dict[Any, list[tuple[Any, Path]]] = {}
        self._piece_s = _BATCH_S  # until some have been timed
        self._lonely_since = time.monotonic()
        self._task = self._ray.remote(run_batch).options(
            num_cpus=resources.cpus,
            num_gpus=resources.gpus,
            memory=resources.memory_bytes or None,
            max_retries=MAX_RETRIES,
        )

    def run(self) -> None:
        """Run all pieces."""
        while self._waiting or self._running:
            self._submit()
            ready, _ = self._ray.wait([*self._running], timeout=_LOOK_S)
            if ready:
                ready, _ = self._ray.wait([*self._running], num_returns=len(self._running), timeout=0)
            for reference in ready:
                self._finish(reference)
            self._check_nodes()

    def wait_for_running(self) -> None:
        """Cancel the tasks that wait for a place, and wait for the others, which ignore it."""
        for reference in self._running:
            self._ray.cancel(reference, force=False)
        while self._running:
            ready, waiting = self._ray.wait([*self._running], num_returns=len(self._running), timeout=_LOOK_S)
            for reference in ready:
                del self._running[reference]
            if not waiting:
                return

    def kill(self) -> None:
        """End all tasks at once."""
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        if self._running:
            self._ray.wait([*self._running], num_returns=len(self._running), timeout=_STOP_S)

    def _submit(self) -> None:
        places = self._engine._fitting(self._resources)
        at_once = self._engine.workers or 2 * places + _QUEUED
        if places:
            self._lonely_since = time.monotonic()
        share = len(self._waiting) // (4 * max(1, min(places, at_once)))
        size = max(1, min(int(_BATCH_S / max(self._piece_s, 1e-9)), _MAX_BATCH, share))
        while self._waiting and len(self._running) < at_once:
            pieces = [self._waiting.popleft() for _ in range(min(size, len(self._waiting)))]
            hides_gpus = not self._resources.gpus
            batch = PieceBatch(self._work, pieces, Path.cwd(), __version__, hides_gpus)
            self._running[self._task.remote(batch)] = pieces

    def _finish(self, reference: Any) -> None:
        pieces = self._running.pop(reference)
        try:
            seconds, host = self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause
            raise (cause if isinstance(cause, Exception) else RunError(str(error))) from None
        except self._ray.exceptions.RayError as error:
            raise RunError(
                f"processes of a piece were lost again and again ({summarize_exception(error)})",
                hint="ask for more memory for each piece: finished pieces are kept",
            ) from error
        _check_shared([path for _, path in pieces], host)
        self._piece_s += (seconds / len(pieces) - self._piece_s) * 0.5
        self._finished(len(pieces))

    def _check_nodes(self) -> None:
        if time.monotonic() - self._lonely_since > _WAIT_FOR_NODES_S:
            raise RunError(f"no machine of the cluster has {self._resources}")


def _check_shared(paths: Sequence[Path], host: str) -> None:
    """Wait for files of another machine.

    Raises:
        RunError: one does not appear.
    """
    waited_until = time.monotonic() + _WAIT_FOR_FILE_S
    for path in paths:
        while not path.exists():
            if time.monotonic() > waited_until:
                raise RunError(
                    f"was written on {host} and is not here",
                    path=path,
                    hint="use a folder that all machines share, under the same path",
                )
            time.sleep(0.2)
            with os.scandir(path.parent):  # asks the server again
                pass
