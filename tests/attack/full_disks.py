# SPDX-License-Identifier: Apache-2.0
"""Disks that are full, closed pipes: one line, and no file under its final name that is not whole."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from doorstate.networks import create_network
from doorstate.networks.card import WeightsCard
from doorstate.networks.weights import save_weights
from tests.attack.processes import run
from tests.attack.samples import POINTS, contents, first_cloud, prepared
from tests.attack.tries import Try, Violation

_LIMITS = (3000, 20_000, 200_000, 2_000_000)  # bytes of a file or of the disk
_PROGRAM = f"{sys.executable} -m doorstate"
_PIPES = {
    "{p} predict --json {c} > /dev/full": 1,
    "{p} predict {c} > /dev/full": 1,
    "{p} info > /dev/full": 1,
    "{p} --help > /dev/full": 1,
    "{p} predict --json {c} {c} {c} | head -c 1": 141,
    "{p} info | head -1": 141,
    "{p} predict {c} 2> /dev/full": 0,
    "{p} predict {c} >&-": 1,
}


def attack_disks(folder: Path, rounds: int) -> Iterator[Try]:
    """Limit the size of files, then that of the disk, where a small one can be mounted."""
    data = prepared(folder / "data", scenes=12)
    weights = folder / "w.safetensors"
    save_weights(weights, create_network("pointnet"), WeightsCard(network="pointnet", num_points=POINTS))
    cloud = first_cloud(folder)
    disk = folder / "disk"
    options = [
        "--network",
        "pointnet",
        "--data",
        data,
        "--points",
        POINTS,
        "--epochs",
        1,
        "--out",
        disk / "out",
    ]
    commands: list[list[object]] = [
        [
            "simulate",
            "--preset",
            "varied",
            "--scenes",
            1,
            "--workers",
            1,
            "--keep",
            "pcd",
            "--out",
            disk / "out",
        ],
        ["prepare", folder / "data-raw", "--points", POINTS, "--workers", 1, "--out", disk / "out"],
        ["join", data, "--out", disk / "out"],
        ["train", *options],
        ["compare", *options, "--folds", 1],
        ["predict", cloud, "--rule", "plane_state", "--out", disk / "out.csv"],
        ["view", cloud, "--rule", "plane_state", "--no-open", "--out", disk / "out.html"],
        ["report", data, "--out", disk / "out"],
    ]
    limits = _LIMITS if rounds > 1 else _LIMITS[:1]
    for arguments in commands if rounds > 1 else commands[1:2]:
        disk.mkdir()
        whole = run(folder, *arguments)
        assert whole.code == 0, whole.err
        expected = contents(disk)
        shutil.rmtree(disk)
        for limit in limits:
            for is_mounted in (False, True):
                disk.mkdir()
                if is_mounted and not _mount(disk, limit):
                    disk.rmdir()
                    continue
                kind = f"full disk in `{arguments[0]}`"
                try:
                    done = run(folder, *arguments, file_bytes=None if is_mounted else limit)
                    found = contents(disk).items()
                finally:
                    if is_mounted:
                        subprocess.run(["umount", disk], check=True)
                is_torn = any(not _is_whole(name, content, expected) for name, content in found)
                yield Try(kind, "torn", Violation.TORN) if is_torn else done.as_try(kind)
                shutil.rmtree(disk)


def attack_pipes(folder: Path, rounds: int) -> Iterator[Try]:
    """Close standard output, or send it to a full disk."""
    cloud = first_cloud(prepared(folder / "data", scenes=1).with_name("data-raw"))
    pipes = _PIPES if rounds > 1 else dict(list(_PIPES.items())[:1])
    for line, code in pipes.items():
        command = "set -o pipefail; " + line.format(p=_PROGRAM, c=cloud)
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
        is_right = done.returncode in (code, 0 if code == 141 else code) and "Traceback" not in done.stderr
        outcome = "one line or none" if is_right else f"exit code {done.returncode}"
        yield Try("full or closed standard output", outcome, None if is_right else Violation.UNCAUGHT)


def _mount(folder: Path, size: int) -> bool:
    command = ["mount", "-t", "tmpfs", "-o", f"size={max(size, 4096)}", "tmpfs", folder]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def _is_whole(name: str, content: bytes, expected: dict[str, bytes]) -> bool:
    """Return True for files as they are on a disk with room; texts with times differ, but end as they do."""
    if ".tmp." in name or Path(name).name.startswith("."):
        return True
    if name not in expected or Path(name).suffix in (".json", ".csv", ".txt", ".html"):
        return len(content) == 0 or content.endswith((b"\n", b"}", b">"))
    return content == expected[name]
