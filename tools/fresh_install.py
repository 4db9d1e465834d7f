# SPDX-License-Identifier: Apache-2.0
"""Build wheel and sdist, install each into an empty environment, and predict the states of PCD files; all timed.

`make fresh-install` runs it; it needs the network. Torch has the version of requirements.lock, all other packages the
version that pip selects for a new user.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Mapping, Sequence
from pathlib import Path

from doorstate.io.pcd import write_pcd
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS
from doorstate.types import STATES

REPOSITORY = Path(__file__).resolve().parents[1]
EASY_POSE = 700  # for rules and networks: the installation is tested, not the accuracy


def main() -> None:
    """Build, install and predict; environments are removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="doorstate-") as name:
        folder = Path(name)
        print("building wheel and sdist", flush=True)
        _timed([sys.executable, "-m", "build", "--outdir", folder, REPOSITORY])
        _, frames = simulate_rows(PRESETS["ogurob"], seed=3, index=EASY_POSE)
        clouds = {state: folder / f"{state}.pcd" for state in STATES}
        for path, frame in zip(clouds.values(), frames, strict=True):
            write_pcd(path, frame.points)
        for pattern in ("*.whl", "*.tar.gz"):
            (distribution,) = folder.glob(pattern)
            with tempfile.TemporaryDirectory(prefix="environment-", dir=folder) as environment:
                _predict(_install(distribution, Path(environment)), clouds)


def _install(distribution: Path, environment: Path) -> Path:
    """Install a distribution and return the folder of its commands."""
    venv.create(environment, with_pip=True)
    binaries = environment / "bin"
    constraint = environment / "constraint.txt"
    lock = (REPOSITORY / "requirements.lock").read_text(encoding="utf-8")
    constraint.write_text(next(line for line in lock.splitlines() if line.startswith("torch==")))
    pip = [binaries / "python", "-m", "pip", "install", "--quiet", "--constraint", constraint]
    print(f"installing {distribution.name} into an empty environment", flush=True)
    _, seconds = _timed([*pip, distribution])
    print(f"pip install {distribution.name}: {seconds:.0f} s", flush=True)
    return binaries


def _predict(binaries: Path, clouds: Mapping[str, Path]) -> None:
    """Predict a door in every state with a rule and every packaged network; exit on a wrong state."""
    listed, _ = _timed([binaries / "doorstate", "info", "--json"])
    packaged = [name for entry in json.loads(listed)["networks"] for name in entry["packaged_weights"]]
    for options in (["--rule", "plane_state"], *(["--network", network] for network in packaged)):
        for state, path in clouds.items():
            output, seconds = _timed([binaries / "doorstate", "predict", path, *options, "--json"])
            predicted = json.loads(output)["state"]
            print(
                f"doorstate predict {path.name} {' '.join(options)}: {predicted}, {seconds:.1f} s",
                flush=True,
            )
            if predicted != state:
                sys.exit(f"fresh_install: {path.name} is {state}, but {predicted} was predicted")


def _timed(command: Sequence[str | Path]) -> tuple[str, float]:
    """Run a command and return its output and seconds; exit if it fails."""
    started = time.perf_counter()
    # Outside the repository, so that nothing of it can be imported.
    finished = subprocess.run(command, cwd=tempfile.gettempdir(), capture_output=True, text=True, check=False)
    if finished.returncode:
        sys.exit(f"fresh_install: {' '.join(map(str, command))}\n{finished.stdout}{finished.stderr}")
    return finished.stdout, time.perf_counter() - started


if __name__ == "__main__":
    main()
