# SPDX-License-Identifier: Apache-2.0
"""Write the lock files: versions and SHA-256 sums of all packages that work on this repository installs.

`make lock` runs it. Versions stay where they still fit. `make lock OPTIONS=--upgrade` takes the newest of all packages,
`OPTIONS="--upgrade-package NAME"` that of one. Versions are resolved for all platforms and for every Python from 3.11.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote
from urllib.request import urlopen

REPOSITORY = Path(__file__).resolve().parents[1]
LOCK = REPOSITORY / "requirements.lock"
_ANY_PLATFORM = ("--universal", "--fork-strategy", "fewest")
PARTS = {  # in the versions of requirements.lock
    "tools/release.lock": ("--group", "release", *_ANY_PLATFORM),
    "requirements-light.lock": ("pyproject.toml", *_ANY_PLATFORM),
    "requirements-container.lock": ("pyproject.toml", "--extra", "serve", "--extra", "mqtt", *_ANY_PLATFORM),
    "ros2/requirements.lock": ("ros2/requirements.txt", "--python-platform", "x86_64-manylinux_2_28"),
}
_OPTIONAL = "# optional: "  # tools/setup.sh reads this comment
_CPU_INDEX = "https://download.pytorch.org/whl/cpu/torch/"
_WHEEL = r"torch-{}(?:\+cpu)?-cp31[123]-cp31[123]-{}\.whl#sha256=([0-9a-f]{{64}})"
_PLATFORM = r"(?:manylinux_2_28_(?:x86_64|aarch64)|macosx_\w+_arm64)"


def main() -> None:
    """Resolve requirements.lock, and the others in its versions."""
    lock = _resolve(LOCK, "pyproject.toml", "--extra", "dev", "--extra", "fast", *_ANY_PLATFORM)
    _write(LOCK, _optional_sampling(_torch_for_cpus(lock, LOCK.read_text(encoding="utf-8"))))
    for name, arguments in PARTS.items():
        path = REPOSITORY / name
        _write(path, _resolve(path, *arguments, "--constraints", LOCK))


def _write(path: Path, lock: str) -> None:
    path.write_text(f"# Written by 'make lock'.\n{lock}", encoding="utf-8")


def _resolve(lock: Path, *arguments: str | Path) -> str:
    """Return a new lock file that prefers the versions of the present one."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "lock"
        if lock.exists():
            output.write_text(lock.read_text(encoding="utf-8").replace(_OPTIONAL, ""), encoding="utf-8")
        options = ["--python-version", "3.11", "--generate-hashes", "--no-annotate", "--no-header", "--quiet"]
        uv = Path(sys.executable).with_name("uv")
        command = [uv, "pip", "compile", *arguments, *options, *sys.argv[1:], "--output-file", output]
        if subprocess.run(command, cwd=REPOSITORY, check=False).returncode:
            sys.exit(f"lock: {lock.name} is unchanged")
        return output.read_text(encoding="utf-8")


def _entry(lock: str, name: str) -> re.Match[str]:
    """Find the lines of a package."""
    found = re.search(rf"^{name}==(\S+)[^\n]*(?:\n    [^\n]*)+\n", lock, flags=re.MULTILINE)
    return found or sys.exit(f"lock: {name} is missing")


def _torch_for_cpus(lock: str, old: str) -> str:
    """Replace the sums of torch's wheels by those of the builds for CPUs, which PyPI lacks for Linux."""
    entry, present = _entry(lock, "torch"), _entry(old, "torch")
    if entry[1] == present[1]:
        return lock.replace(entry[0], present[0])
    try:
        with urlopen(_CPU_INDEX, timeout=30) as page:
            links = unquote(page.read().decode())
    except OSError as error:
        sys.exit(f"lock: torch stays at {present[1]}: {_CPU_INDEX}: {error}")
    sums = sorted(set(re.findall(_WHEEL.format(re.escape(entry[1]), _PLATFORM), links)))
    if not sums:
        sys.exit(f"lock: torch stays at {present[1]}: {_CPU_INDEX} has no wheels of {entry[1]}")
    lines = [f"torch=={entry[1]}", *(f"    --hash=sha256:{digest}" for digest in sums)]
    return lock.replace(entry[0], " \\\n".join(lines) + "\n")


def _optional_sampling(lock: str) -> str:
    """Turn fpsample into a comment: it is built from source, which may fail."""
    entry = _entry(lock, "fpsample")
    return f"{_OPTIONAL}{' '.join(entry[0].replace(chr(92), ' ').split())}\n{lock.replace(entry[0], '')}"


if __name__ == "__main__":
    main()
