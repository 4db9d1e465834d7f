# SPDX-License-Identifier: Apache-2.0
"""Run the attacks: `python -m tests.attack service --seconds 60`."""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from tests.attack.service import attack_service


def main() -> None:
    """Run one attack, and print its outcome as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.attack", description=__doc__)
    commands = parser.add_subparsers(dest="attack", required=True)
    service = commands.add_parser("service", help="hostile clients beside honest ones")
    service.add_argument("--seconds", type=float, default=60.0, help="duration of each part")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="doorstate-") as folder:
        print(json.dumps(attack_service(Path(folder), arguments.seconds), indent=2))


if __name__ == "__main__":
    main()
