# SPDX-License-Identifier: Apache-2.0
"""Build wheel and sdist, install them into empty environments, and measure what a new user waits and pays for.

`make fresh-install` runs it; it needs the network. It prints, for the wheel alone and with the extra `train`: seconds
from `pip install` to the first answer, megabytes beside Python, and processor seconds of a cold `doorstate predict`.
Torch has the version of requirements.lock and comes from PyTorch's index of CPU builds, all other packages have the
version that pip selects. Every packaged network and a rule must name the state of an easy door in all three states, and
what needs an extra must say so.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from doorstate.io.pcd import write_pcd
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.types import STATES

REPOSITORY = Path(__file__).resolve().parents[1]
EASY_POSE = 650  # for rules and networks: the installation is tested, not the accuracy
REACH = {"seconds to the first answer": 25.0, "MB beside Python": 350.0, "CPU seconds of a cold predict": 1.0}
WITHOUT_EXTRAS = {
    "train --network pointnet --data data --out run": "train",
    "export": "onnx",
    "serve": "serve",
}
_COLD_RUNS = 5
_CPU_INDEX = "https://download.pytorch.org/whl/cpu"


class Finished(NamedTuple):
    """Output and costs of a command that has ended."""

    code: int
    output: str
    errors: str
    seconds: float
    cpu_seconds: float


def main() -> None:
    """Build, install, predict and measure; environments are removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="doorstate-") as name:
        folder = Path(name)
        print("building wheel and sdist", flush=True)
        _run([sys.executable, "-m", "build", "--outdir", folder, REPOSITORY])
        _, frames = simulate_rows(PRESETS["ogurob"], seed=3, index=EASY_POSE)
        clouds = {state: folder / f"{state}.pcd" for state in STATES}
        for path, frame in zip(clouds.values(), frames, strict=True):
            write_pcd(path, frame.points)
        (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB", flush=True)
        for distribution, extra in ((wheel, ""), (sdist, ""), (wheel, "train")):
            with tempfile.TemporaryDirectory(prefix="environment-", dir=folder) as environment:
                _measure(distribution, extra, Path(environment), clouds)


def _measure(distribution: Path, extra: str, environment: Path, clouds: Mapping[str, Path]) -> None:
    """Install a distribution, predict, and print the figures; exit on a wrong state or a missing message."""
    venv.create(environment, with_pip=True)
    binaries, packages = environment / "bin", next(environment.glob("lib/python*/site-packages"))
    empty_mb, started = _megabytes(packages), time.perf_counter()
    _run(
        [
            binaries / "python",
            "-m",
            "pip",
            "install",
            "--quiet",
            *_requirement(distribution, extra, environment),
        ]
    )
    first = _predict(binaries, clouds["open"])
    seconds = time.perf_counter() - started
    megabytes = _megabytes(packages) - empty_mb
    _check_state("open", first)
    cold = min(_predict(binaries, clouds["open"]).cpu_seconds for _ in range(_COLD_RUNS))
    name = f"{distribution.name}{f'[{extra}]' if extra else ''}"
    figures = dict(zip(REACH, (seconds, megabytes, cold), strict=True))
    for figure, value in figures.items():
        missed = not extra and value > REACH[figure]
        print(f"{name}: {value:.2f} {figure}{f' (reach: {REACH[figure]:.0f})' if missed else ''}", flush=True)
    _predict_all(binaries, clouds)
    for arguments, missing in WITHOUT_EXTRAS.items() if not extra else ():
        finished = _start([binaries / "doorstate", *arguments.split()])
        if finished.code != 1 or f'pip install "doorstate[{missing}]"' not in finished.errors:
            sys.exit(f"fresh_install: doorstate {arguments}: {finished.errors}")


def _requirement(distribution: Path, extra: str, environment: Path) -> list[str | Path]:
    """Return the arguments of `pip install`; only torch needs a constraint and another index."""
    if not extra:
        return [distribution]
    constraint = environment / "constraint.txt"
    lock = (REPOSITORY / "requirements.lock").read_text(encoding="utf-8")
    constraint.write_text(next(line for line in lock.splitlines() if line.startswith("torch==")))
    return ["--constraint", constraint, "--extra-index-url", _CPU_INDEX, f"{distribution}[{extra}]"]


def _predict_all(binaries: Path, clouds: Mapping[str, Path]) -> None:
    """Predict a door in every state with a rule and every packaged network; exit on a wrong state."""
    listed = json.loads(_run([binaries / "doorstate", "info", "--json"]).output)
    packaged = [name for entry in listed["networks"] for name in entry["packaged_weights"]]
    for options in (["--rule", "plane_state"], *(["--network", network] for network in packaged)):
        for state, path in clouds.items():
            _check_state(state, _predict(binaries, path, *options))


def _predict(binaries: Path, path: Path, *options: str) -> Finished:
    return _run([binaries / "doorstate", "predict", path, *options, "--json"])


def _check_state(state: str, finished: Finished) -> None:
    predicted = json.loads(finished.output)["state"]
    if predicted != state:
        sys.exit(f"fresh_install: {state} was predicted as {predicted}: {finished.output}")


def _megabytes(folder: Path) -> float:
    """Return the size of all files, in millions of bytes."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6


def _run(command: Sequence[str | Path]) -> Finished:
    """Run a command; exit if it fails."""
    finished = _start(command)
    if finished.code:
        sys.exit(f"fresh_install: {' '.join(map(str, command))}\n{finished.output}{finished.errors}")
    return finished


def _start(command: Sequence[str | Path]) -> Finished:
    """Run a command outside the repository, so that nothing of it can be imported."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        command, cwd=tempfile.gettempdir(), env=clean, capture_output=True, text=True, check=False
    )
    seconds, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Finished(done.returncode, done.stdout, done.stderr, seconds, cpu)


if __name__ == "__main__":
    main()
