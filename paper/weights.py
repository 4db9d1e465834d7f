# SPDX-License-Identifier: Apache-2.0
"""Put trained weights into the package, as float16, with a model card each.

python tools/package_weights.py runs/mixture-wide   # default weights, after `make publish EXPERIMENT=mixture-wide`
python tools/package_weights.py runs/weights ogurob-  # with a name before the network's

Weights of protocol `all` have seen every sample: how well their recipe does and how sure the answers are comes from the
published cross-validations. Others were tested themselves, and what is published of that test is what the card shows.
What tells of the packaged weights elsewhere is to be made anew then: CONTRIBUTING.md, "Publishing".
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from doorstate._files import write_text
from doorstate.clouds.augmentation import Augmentation
from doorstate.dataset.store import open_dataset
from doorstate.evaluation.calibration import calibrate, reliability
from doorstate.evaluation.factors import factors_table, kinds_table
from doorstate.evaluation.head_tables import answers_table, four_answers_table, presence_table
from doorstate.evaluation.metrics import scores
from doorstate.evaluation.resolution import fewest_points
from doorstate.evaluation.results import Answers, ComparisonResults, Predictions, load_results
from doorstate.evaluation.score_tables import pooled_confusion
from doorstate.evaluation.table import Table
from doorstate.networks.weights import load_weights, save_weights
from doorstate.training.calibration import abstain_threshold, at_temperature
from doorstate.training.run_folder import read_json, run_of
from doorstate.types import DECISION_THRESHOLD, STATES

from .pages.results import NAMES
from .pages.templates import template
from .pages.zoo import PAGE, page
from .publish import rows_of
from .studies import Asked, read_asked, resolution_results, study_table

REPOSITORY = Path(__file__).resolve().parents[1]
RESULTS, EXPERIMENTS = REPOSITORY / "results", REPOSITORY / "paper" / "experiments"
WEIGHTS = REPOSITORY / "src" / "doorstate" / "networks" / "pretrained"
_MANY = 30e6  # bytes of one set of networks: 19 MB without heads, which take half as much again
_FEWEST, _LOST = (
    1024,
    0.002,
)  # default points are no fewer, and lose no more macro-F1 on samples never learned from
_WRONG_SHARE = (
    0.05  # of the validation samples that are answered at all; with less, few would be (paper/log.md)
)


class Evidence(NamedTuple):
    """What is published of a network, as its weights and its card need it."""

    temperature: float
    abstain_below: float
    default_points: int | None
    card: str  # template
    shown: dict[str, Any]  # in it


def main(folder: str, prefix: str = "") -> None:
    """Package every network of a comparison that has been trained there.

    Args:
        folder: of the comparison.
        prefix: what comes before a network's name in the name of its weights.
    """
    asked = read_json(Path(folder) / "comparison.json")
    evidence = _of_recipe() if asked["protocol"] == "all" else _of_weights(asked["name"])
    unchanged = Augmentation().model_dump(mode="json")
    paths = []
    for network_name in asked["networks"]:
        name = f"{prefix}{network_name}"
        run = run_of(Path(folder), network_name, 0)
        if not (run.finished and run.weights.is_file()):
            print(f"{name}: not trained in {folder}, left as it is")
            continue
        network, card = load_weights(run.weights)
        found = evidence(network_name, card.num_points)
        target = WEIGHTS / f"{name}.safetensors"
        card = card.model_copy(
            update={
                "temperature": found.temperature,
                "abstain_below": found.abstain_below,
                "default_points": found.default_points,
            }
        )
        save_weights(target, network, card, half=True)
        metrics, config = run.read_metrics(), read_json(run.config)
        recipe = config["recipe"]
        text = template(found.card).render(
            name=name,
            title=NAMES[network_name],
            parameters=sum(p.numel() for p in network.parameters()),
            recipe=recipe,
            begun=config.get("start_from") and Path(asked["start_from"]).name,
            augmentation={
                key.replace("_", " "): value
                for key, value in recipe["augmentation"].items()
                if value != unchanged[key]
            },
            environment=read_json(run.environment),
            minutes=metrics["seconds"] / 60,
            samples=metrics["train_samples"],
            weights=card,
            temperature=found.temperature,
            abstain_below=found.abstain_below,
            states=STATES,
            megabytes=target.stat().st_size / 1e6,
            sha256=hashlib.sha256(target.read_bytes()).hexdigest(),
            **found.shown,
        )
        write_text(target.with_suffix(".md"), text)
        paths.append(target)
        print(f"{target}: {target.stat().st_size / 1e6:.1f} MB")
    write_text(PAGE, page())
    total = sum(path.stat().st_size for path in paths)
    print(f"together {total / 1e6:.1f} MB")
    if total > _MANY:
        sys.exit(f"more than {_MANY / 1e6:.0f} MB: too much for the package")


def _of_recipe() -> Callable[[str, int], Evidence]:
    """Scores of the recipe, cross-validated over the folds of two protocols."""
    rows = RESULTS / "ogurob-4096"
    paper, by_pose = (load_results(RESULTS / name, rows) for name in ("paper", "by-pose"))

    def evidence(network: str, trained_points: int) -> Evidence:
        calibrated = calibrate(paper, network)
        if calibrated is None:
            sys.exit(f"results/paper: no validation answers of {network}")
        return Evidence(
            round(median(calibrated.temperatures), 4),
            0.0,
            _default_points("by-pose", network, trained_points),
            "ogurob_card.md.j2",
            {
                "tables": _tables_of(network, _study_tables("by-pose")),
                "error": reliability(calibrated.true, calibrated.scaled).error,
                "found": [
                    {"protocol": each.comparison.protocol, **_scores(each, network)}
                    for each in (paper, by_pose)
                ],
            },
        )

    return evidence


def _of_weights(experiment: str) -> Callable[[str, int], Evidence]:
    """Scores of the very weights on test samples of their own, in their world and in others."""
    comparison = RESULTS / experiment
    if not comparison.is_dir():
        sys.exit(f"{comparison}: not published yet")
    rows = rows_of(comparison, RESULTS)
    results, dataset = load_results(comparison, rows), open_dataset(rows)

    def evidence(network: str, trained_points: int) -> Evidence:
        (run,) = results.runs_of(network)
        calibrated = calibrate(results, network)
        if calibrated is None or run.validation is None:
            sys.exit(f"{comparison}: no validation answers of {network}")
        temperature = round(calibrated.temperatures[0], 4)
        validated = at_temperature(run.validation.probabilities, temperature)
        threshold = abstain_threshold(validated, run.validation.true, _WRONG_SHARE)
        given = results.answers(network)
        answered = (calibrated.scaled.max(axis=1) >= threshold) & _seems_a_door(
            results.pooled(network), given
        )
        right = calibrated.scaled.argmax(axis=1) == calibrated.true
        tables = [
            make(results, dataset)
            for make in (answers_table, four_answers_table, presence_table, kinds_table, factors_table)
        ]
        return Evidence(
            temperature,
            threshold,
            _default_points(experiment, network, trained_points),
            "mixture_card.md.j2",
            {
                "error": reliability(calibrated.true, calibrated.scaled).error,
                "found": _scores(results, network),
                "wrong_share": _WRONG_SHARE,
                "answered": float(answered.mean()),
                "right_of_answered": float(np.mean(right[answered])) if answered.any() else float("nan"),
                "tables": _tables_of(network, (*tables, *_study_tables(experiment))),
            },
        )

    return evidence


def _seems_a_door(pooled: Predictions, given: Answers | None) -> NDArray[np.bool_]:
    """Of which samples a predictor would not say that there is no door."""
    if given is None or "p_door" not in given.columns:
        return np.ones(len(pooled), bool)
    p_door = dict(zip(given.sample_ids, given.columns["p_door"], strict=True))
    return np.array([p_door[sample] >= DECISION_THRESHOLD for sample in pooled.sample_ids])


def _studies(experiment: str) -> Iterator[Asked]:
    """Published studies of the weights of an experiment; what is published of other weights ends the tool."""
    for asked in map(read_asked, sorted(EXPERIMENTS.glob("*.toml"))):
        if asked.command == "compare" or experiment not in asked.begins_with:
            continue
        published = list((RESULTS / asked.name).rglob("comparison.json"))
        begun_with = {Path(read_json(path)["start_from"]).name for path in published}
        if published and experiment not in begun_with:
            sys.exit(
                f"{RESULTS / asked.name}: is of {' and '.join(sorted(begun_with))}, not of {experiment}: "
                f"make reproduce EXPERIMENT={asked.name}, publish, and package again"
            )
        if published:
            yield asked


def _study_tables(experiment: str) -> Iterator[Table]:
    return (study_table(asked, RESULTS) for asked in _studies(experiment))


def _default_points(experiment: str, network: str, trained: int) -> int | None:
    """As few points as lose nothing, as the study of an experiment's weights tells; None if it tells nothing."""
    for asked in _studies(experiment):
        if asked.command == "resolution":
            return fewest_points(resolution_results(asked, RESULTS), network, _FEWEST, trained, _LOST)
    return None


def _tables_of(network: str, tables: Iterable[Table]) -> list[str]:
    parts = (_of_network(table, network) for table in tables)
    return [part.to_markdown().strip() for part in parts if part.rows]


def _of_network(table: Table, network: str) -> Table:
    """The lines of one network, without its name before each."""
    return replace(
        table,
        columns=table.columns[1:],
        rows=tuple(row[1:] for row in table.rows if row[0] == network),
        text_columns=max(1, table.text_columns - 1),
    )


def _scores(results: ComparisonResults, network: str) -> dict[str, object]:
    score = scores(pooled_confusion(results, network))
    return {
        "samples": len(results.pooled(network)),
        "macro_f1": float(score.macro.f1),
        "recall": dict(zip(STATES, score.recall.tolist(), strict=True)),
    }


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(*sys.argv[1:])
