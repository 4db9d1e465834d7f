# SPDX-License-Identifier: Apache-2.0
"""Every engine, and a cluster of two machines with one processor each, both simulated on this machine."""

from __future__ import annotations

import os
from collections.abc import Iterator
from unittest.mock import patch

import pytest

from doorstate._jobs import Engine, ProcessEngine, RayEngine

_OBJECT_STORE_BYTES = 80 * 2**20
# A lost machine is noticed within a second.
_SYSTEM = {
    "health_check_initial_delay_ms": 0,
    "health_check_period_ms": 300,
    "health_check_timeout_ms": 500,
    "health_check_failure_threshold": 2,
    "worker_niceness": 0,  # Ray's own lets every other process go first
}


class TwoMachines:
    """Head and node of a cluster; the node can be lost, and comes back for the next test."""

    def __init__(self) -> None:
        import ray
        from ray.cluster_utils import Cluster

        self._cluster = Cluster()
        self._node = None
        # Ray ends the whole process at a SIGTERM, which a test may get from its own.
        with patch.object(ray._private.utils, "set_sigterm_handler", lambda handler: None):
            self._add(include_dashboard=False, _system_config=_SYSTEM)
            self.mend()

    @property
    def address(self) -> str:
        return self._cluster.address

    def mend(self) -> None:
        """Start the node, unless it runs."""
        if self._node is None:
            self._node = self._add()

    def lose_node(self) -> None:
        """Kill all processes of the node."""
        self._cluster.remove_node(self._node, allow_graceful=False)
        self._node = None

    def shutdown(self) -> None:
        self._cluster.shutdown()

    def _add(self, **options: object) -> object:
        return self._cluster.add_node(num_cpus=1, object_store_memory=_OBJECT_STORE_BYTES, **options)


@pytest.fixture(scope="session")
def machines() -> Iterator[TwoMachines]:
    """The cluster; skipped without Ray."""
    pytest.importorskip("ray", reason="Ray is not installed: the extra cluster brings it")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("OMP_NUM_THREADS", "1")
        patch.delenv("RAY_ADDRESS", raising=False)
        cluster = TwoMachines()
        yield cluster
        cluster.shutdown()


@pytest.fixture
def cluster(machines: TwoMachines) -> TwoMachines:
    """The cluster with both machines."""
    machines.mend()
    return machines


@pytest.fixture
def ray_engine(cluster: TwoMachines) -> Iterator[RayEngine]:
    """The engine on both machines."""
    assert "RAY_ADDRESS" not in os.environ
    with RayEngine(cluster.address) as engine:
        yield engine


@pytest.fixture(params=["this process", "processes", "ray"])
def engine(request: pytest.FixtureRequest) -> Engine:
    """Every engine, the first two with an own contract for a killed process."""
    if request.param == "ray":
        return request.getfixturevalue("ray_engine")
    return ProcessEngine(1 if request.param == "this process" else 2)
