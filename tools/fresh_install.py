# SPDX-License-Identifier: Apache-2.0
"""A new user's path, timed: build wheel and sdist, install each into an empty environment, ask for states of PCDs.

python tools/fresh_install.py     # needs the network; `make fresh-install`

Torch is held to the version of requirements.lock, and nothing else is: that is what a user gets.
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
PLAIN_POSE = 700  # easy for rules and networks: it is the installation that is tested


def main() -> None:
    """Build, install, ask; the environments are gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="doorstate-") as name:
        folder = Path(name)
        print("building wheel and sdist", flush=True)
        _timed([sys.executable, "-m", "build", "--outdir", folder, REPOSITORY])
        _, frames = simulate_rows(PRESETS["ogurob"], seed=3, index=PLAIN_POSE)
        clouds = {state: folder / f"{state}.pcd" for state in STATES}
        for path, frame in zip(clouds.values(), frames, strict=True):
            write_pcd(path, frame.points)
        for pattern in ("*.whl", "*.tar.gz"):
            (distribution,) = folder.glob(pattern)
            with tempfile.TemporaryDirectory(prefix="environment-", dir=folder) as environment:
                _ask(_install(distribution, Path(environment)), clouds)


def _install(distribution: Path, environment: Path) -> Path:
    """Where the commands of the environment are."""
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


def _ask(binaries: Path, clouds: Mapping[str, Path]) -> None:
    """Every packaged network and a rule, of a door in every state; a wrong answer ends everything."""
    listed, _ = _timed([binaries / "doorstate", "info", "--json"])
    packaged = [name for each in json.loads(listed)["networks"] for name in each["packaged_weights"]]
    for options in (["--rule", "plane_state"], *(["--network", network] for network in packaged)):
        for state, path in clouds.items():
            said, seconds = _timed([binaries / "doorstate", "predict", path, *options, "--json"])
            answer = json.loads(said)["state"]
            print(
                f"doorstate predict {path.name} {' '.join(options)}: {answer}, {seconds:.1f} s",
                flush=True,
            )
            if answer != state:
                sys.exit(f"fresh_install: {path.name} is {state}, and the answer was {answer}")


def _timed(command: Sequence[str | Path]) -> tuple[str, float]:
    """Standard output and seconds; its error ends everything."""
    started = time.perf_counter()
    # Outside the repository, so that nothing of it can be imported.
    finished = subprocess.run(command, cwd=tempfile.gettempdir(), capture_output=True, text=True, check=False)
    if finished.returncode:
        sys.exit(f"fresh_install: {' '.join(map(str, command))}\n{finished.stdout}{finished.stderr}")
    return finished.stdout, time.perf_counter() - started


if __name__ == "__main__":
    main()
