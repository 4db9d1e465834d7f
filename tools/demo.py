# SPDX-License-Identifier: Apache-2.0
"""The whole pipeline, small: simulate, prepare, cross-validate five networks, report, classify files.

Every step is a command that anybody can type; each is printed before it runs. Started again, finished steps are kept.
"""

from __future__ import annotations

import sys
import time

from doorstate_command import REPOSITORY, doorstate


def main(folder: str) -> None:
    """Run the demo into `folder`, a path below the repository."""
    started = time.monotonic()
    doorstate(f"simulate --preset ogurob --poses 80 --out {folder}/simulated")
    doorstate(f"prepare {folder}/simulated --points 512 --out {folder}/clouds")
    doorstate(f"compare experiments/demo.toml --data {folder}/clouds --jobs 2 --out {folder}/comparison")
    doorstate(f"report {folder}/comparison --out {folder}/report")
    # New doors as files, from another seed: what a robot would hand over.
    doorstate(f"simulate --preset ogurob --poses 5 --seed 7 --keep pcd --out {folder}/new")
    doorstate(
        f"predict {folder}/new/pcd --weights {folder}/comparison/runs/pointnet2/fold0/weights.safetensors"
    )
    # The same files with the weights of the package, which have seen the complete data set.
    doorstate(f"predict {folder}/new/pcd")
    page = (REPOSITORY / folder / "report" / "report.html").resolve()
    print(f"\nThe report: {page}\nDone in {(time.monotonic() - started) / 60:.1f} minutes.")


if __name__ == "__main__":
    main(*sys.argv[1:])
