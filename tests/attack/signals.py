# SPDX-License-Identifier: Apache-2.0
"""SIGTERM and SIGINT in commands that take long: one line, the right exit code, nothing left."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

from doorstate._files import is_scratch
from tests.attack.processes import Command, wait_for_handlers
from tests.attack.samples import POINTS, first_cloud, prepared
from tests.attack.tries import Try, Violation

_CODES = {signal.SIGTERM: 143, signal.SIGINT: 130}
_STEP_S = 0.7


def attack_commands(folder: Path, rounds: int) -> Iterator[Try]:
    """End commands at several times after their start."""
    data = prepared(folder / "data", scenes=12)
    cloud, raw = first_cloud(folder), folder / "data-raw"
    options = ["--network", "pointnet", "--data", data, "--points", POINTS, "--epochs", 900, "--out"]
    commands: list[list[object]] = [
        ["simulate", "--preset", "varied", "--scenes", 900, "--workers", 1, "--out"],
        ["simulate", "--preset", "varied", "--scenes", 900, "--workers", 2, "--out"],
        ["prepare", raw, "--points", 9000, "--workers", 1, "--out"],
        ["train", *options],
        ["compare", "--folds", 1, *options],
        ["predict", *[cloud] * 2000, "--out"],
        ["evaluate", raw / "pcd", *["--rule", "wall_leaf_angle"], "--out"],
        ["view", "--live", raw, "--port", 0, "--no-open", "--threads"],
        ["export", "--network", "pointnet2", "--clouds", 3000, "--out"],
    ]
    chosen = commands if rounds > 1 else commands[:1]
    for number in range(max(1, min(rounds // 10, 5))):
        for arguments in chosen:
            for kind, code in _CODES.items():
                out = folder / f"out{time.monotonic_ns()}{'.csv' if arguments[0] == 'predict' else ''}"
                if arguments[0] == "export":
                    out = out.with_suffix(".onnx")
                last = 1 if arguments[0] == "view" else out
                running = Command(folder, [*arguments, last])
                wait_for_handlers(running.pid)
                time.sleep(_STEP_S * (number + 1))
                os.kill(running.pid, kind)
                done = running.wait(60)
                name = f"{signal.Signals(kind).name} in `{arguments[0]}`"
                left = [path for path in out.rglob("*") if is_scratch(path)] if out.is_dir() else []
                one = done.as_try(name, (code, -kind, 0))
                yield Try(name, "temporary files are left", Violation.TORN) if left else one
