# SPDX-License-Identifier: Apache-2.0
"""Put the weights of a finished run into the package, as float16: `package_weights.py RUN_FOLDER...`."""

from __future__ import annotations

import sys
from pathlib import Path

from doorstate.training.run_folder import RunFolder
from doorstate.training.weights import load_weights, save_weights

WEIGHTS = Path(__file__).resolve().parents[1] / "src" / "doorstate" / "deployment" / "weights"


def main(folders: list[str]) -> None:
    """Package each run."""
    for folder in folders:
        run = RunFolder(Path(folder))
        network, card = load_weights(run.weights)
        metrics = run.read_metrics()
        trained_on = f"{card.trained_on}, test macro-F1 {metrics['test_macro_f1']:.4f}"
        target = WEIGHTS / f"{card.network}.safetensors"
        save_weights(target, network, card.model_copy(update={"trained_on": trained_on}), half=True)
        print(f"{target}: {target.stat().st_size / 1e6:.1f} MB; {trained_on}")


if __name__ == "__main__":
    main(sys.argv[1:])
