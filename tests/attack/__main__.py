# SPDX-License-Identifier: Apache-2.0
"""Repeat all attacks, or some: `python -m tests.attack`, `python -m tests.attack weights graphs --rounds 10`.

`python -m tests.attack service --seconds 60` attacks the service, and prints figures instead of a table;
with `--one-address` all of its clients have the same address.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from tests.attack import ATTACKS
from tests.attack.service import attack_service
from tests.attack.tries import Try, table


def main() -> None:
    """Run attacks and print their table; exit with 1 after an outcome that must not be."""
    parser = argparse.ArgumentParser(prog="python -m tests.attack", description=__doc__)
    parser.add_argument(
        "names", nargs="*", choices=[*ATTACKS, "service", []], help="all but service by default"
    )
    parser.add_argument("--rounds", type=int, default=100, help="tries of what is tried at several places")
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="duration of each part of the attack on the service"
    )
    parser.add_argument(
        "--one-address", action="store_true", help="one address for all clients of the attack on the service"
    )
    arguments = parser.parse_args()
    if "service" in arguments.names:
        with tempfile.TemporaryDirectory(prefix="doorstate-") as folder:
            figures = attack_service(Path(folder), arguments.seconds, arguments.one_address)
            print(json.dumps(figures, indent=2))
        return
    tries: list[Try] = []
    for name in arguments.names or ATTACKS:
        started = time.perf_counter()
        count = len(tries)
        with tempfile.TemporaryDirectory(prefix="doorstate-") as folder:
            for one in ATTACKS[name](Path(folder), arguments.rounds):
                tries.append(one)
                if one.violation:
                    print(f"  {one.kind}: {one.outcome}", file=sys.stderr, flush=True)
        seconds = time.perf_counter() - started
        print(f"{name}: {len(tries) - count} in {seconds:.0f} s", file=sys.stderr, flush=True)
    print(table(tries), end="")
    sys.exit(any(one.violation for one in tries))


if __name__ == "__main__":
    main()
