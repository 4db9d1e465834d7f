# SPDX-License-Identifier: Apache-2.0
"""Put weights trained on everything into the package, as float16, with a model card each.

python tools/package_weights.py runs/weights      # after `make reproduce EXPERIMENT=weights`

How well the recipe does and how sure the answers are comes from the published cross-validation in results/. What tells
of the packaged weights elsewhere is to be made anew then: CONTRIBUTING.md, "Publishing".
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from statistics import median

from results_page import NAMES
from templates import template
from zoo_page import PAGE, page

from doorstate.clouds.augment import Augmentation
from doorstate.evaluation.calibration import calibrate, reliability
from doorstate.evaluation.metrics import scores
from doorstate.evaluation.results import ComparisonResults, load_results
from doorstate.evaluation.score_tables import pooled_confusion
from doorstate.files import write_text
from doorstate.training.comparison import run_of
from doorstate.training.run_folder import read_json
from doorstate.training.weights import load_weights, save_weights
from doorstate.types import STATES

REPOSITORY = Path(__file__).resolve().parents[1]
RESULTS = REPOSITORY / "results"
WEIGHTS = REPOSITORY / "src" / "doorstate" / "deployment" / "weights"
_MANY = 25e6


def main(folder: str) -> None:
    """Package every network of a comparison with protocol `all`."""
    rows = RESULTS / "ogurob-4096"
    paper, by_pose = (load_results(RESULTS / name, rows) for name in ("paper", "by-pose"))
    model_card = template("model_card.md.j2")
    unchanged = Augmentation().model_dump(mode="json")
    for name in read_json(Path(folder) / "comparison.json")["networks"]:
        run = run_of(Path(folder), name, 0)
        network, card = load_weights(run.weights)
        calibrated = calibrate(paper, name)
        if calibrated is None:
            sys.exit(f"results/paper: no validation answers of {name}")
        temperature = round(median(calibrated.temperatures), 4)
        target = WEIGHTS / f"{name}.safetensors"
        save_weights(target, network, card.model_copy(update={"temperature": temperature}), half=True)
        metrics, recipe = run.read_metrics(), read_json(run.config)["recipe"]
        text = model_card.render(
            name=name,
            title=NAMES[name],
            parameters=sum(p.numel() for p in network.parameters()),
            recipe=recipe,
            augmentation={
                key.replace("_", " "): value
                for key, value in recipe["augmentation"].items()
                if value != unchanged[key]
            },
            environment=read_json(run.environment),
            minutes=metrics["seconds"] / 60,
            samples=metrics["train_samples"],
            points=card.num_points,
            temperature=temperature,
            error=reliability(calibrated.true, calibrated.scaled).error,
            found=[_found(results, name) for results in (paper, by_pose)],
            states=STATES,
            megabytes=target.stat().st_size / 1e6,
            sha256=hashlib.sha256(target.read_bytes()).hexdigest(),
        )
        write_text(target.with_suffix(".md"), text)
        print(f"{target}: {target.stat().st_size / 1e6:.1f} MB")
    write_text(PAGE, page())
    total = sum(path.stat().st_size for path in WEIGHTS.glob("*.safetensors"))
    print(f"together {total / 1e6:.1f} MB")
    if total > _MANY:
        sys.exit(f"more than {_MANY / 1e6:.0f} MB: too much for the package")


def _found(results: ComparisonResults, network: str) -> dict[str, object]:
    score = scores(pooled_confusion(results, network))
    return {
        "protocol": results.comparison.protocol,
        "samples": len(results.pooled(network)),
        "macro_f1": float(score.macro.f1),
        "recall": dict(zip(STATES, score.recall.tolist(), strict=True)),
    }


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
