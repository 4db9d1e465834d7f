# SPDX-License-Identifier: Apache-2.0
"""Resumable jobs in pieces: each piece writes one file atomically, in any order, in any process, on any machine.

`pieces` holds the contract, `processes` and `ray_engine` the two engines, `results` pieces that return something.
"""

from doorstate._jobs.pieces import (
    Engine,
    Progress,
    WorkersOrEngine,
    engine_of,
    no_progress,
    piece_paths,
    run_pieces,
)
from doorstate._jobs.processes import ProcessEngine, interrupts_blocked
from doorstate._jobs.ray_engine import RayEngine
from doorstate._jobs.resources import Resources, default_workers
from doorstate._jobs.results import map_pieces
from doorstate._jobs.shard import Shard

__all__ = [
    "Engine",
    "ProcessEngine",
    "Progress",
    "RayEngine",
    "Resources",
    "Shard",
    "WorkersOrEngine",
    "default_workers",
    "engine_of",
    "interrupts_blocked",
    "map_pieces",
    "no_progress",
    "piece_paths",
    "run_pieces",
]
