# SPDX-License-Identifier: Apache-2.0
"""A split to choose a recipe on: what one fold may learn from, with the blocks of another fold held out of it.

Under protocol `by-pose` validation samples stand beside trained ones and say little of places that were never seen
(ADR 7). Nothing that the outer fold tests is used.

    python tools/nested_splits.py runs/by-pose/splits.csv --out runs/by-pose-choice/splits.csv
    doorstate compare experiments/by-pose.toml --folds 1 --out runs/by-pose-choice
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from doorstate.dataset.splits import Role, read_splits, write_splits


def nested(outer: Mapping[str, Role], inner: Mapping[str, Role]) -> dict[str, Role]:
    """Roles in which the inner fold tests, of samples that the outer fold may learn from."""
    return {sample: role if outer[sample] in ("train", "val") else "unused" for sample, role in inner.items()}


def main() -> None:
    """Write the split of one fold inside another."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("splits", type=Path, help="splits.csv of a comparison")
    parser.add_argument("--outer", type=int, default=0, help="fold whose tested samples nobody may see (0)")
    parser.add_argument("--inner", type=int, default=4, help="fold whose blocks are held out (4)")
    parser.add_argument("--out", type=Path, required=True, help="splits.csv of a new comparison")
    options = parser.parse_args()
    splits = read_splits(options.splits)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_splits(options.out, [nested(splits[options.outer], splits[options.inner])])


if __name__ == "__main__":
    main()
