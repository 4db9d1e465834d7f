# SPDX-License-Identifier: Apache-2.0
"""Look for published vulnerabilities of all packages in the lock files; exit with 1 if there are any.

`make audit` runs it. Where no index of advisories can be reached it says so, and exits with 0.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
LOCKS = (
    "requirements.lock",
    "requirements-light.lock",
    "requirements-container.lock",
    "ros2/requirements.lock",
    "tools/release.lock",
)


def main() -> None:
    """Audit and report on standard output."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        options = ["--disable-pip", "--require-hashes", "--progress-spinner", "off", "--format", "json"]
        locks = [word for lock in LOCKS for word in ("--requirement", str(REPOSITORY / lock))]
        command = [sys.executable, "-m", "pip_audit", *options, "--output", str(report), *locks]
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        packages = json.loads(report.read_text(encoding="utf-8"))["dependencies"] if report.exists() else []
    audited = [package for package in packages if "skip_reason" not in package]
    if not audited:
        reason = "it knows none of the packages" if packages else finished.stderr.strip().rpartition("\n")[2]
        print(f"audit: skipped, no index of advisories can be reached: {reason[:300]}")
        return
    found = [(package, entry) for package in audited for entry in package["vulns"]]
    for package, entry in found:
        fixed = ", ".join(entry["fix_versions"]) or "none yet"
        print(f"audit: {package['name']} {package['version']}: {entry['id']} (fixed in: {fixed})")
    print(f"audit: {len(audited)} packages, {len(found)} vulnerabilities")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
