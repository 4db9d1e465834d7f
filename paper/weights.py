# SPDX-License-Identifier: Apache-2.0
"""Store trained weights for the package, with calibration and model cards.

Weights of protocol `all` were trained on every sample; the published cross-validations of their recipe stand for them.
Other weights were tested, and their own published test counts.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from doorstate._files import write_text
from doorstate.evaluation.answers import count_answers
from doorstate.evaluation.calibration import calibrate, labels_and_probabilities, reliability
from doorstate.evaluation.heads import door_calibration, standard_errors, with_finder
from doorstate.evaluation.manifest import number_values, text_values
from doorstate.evaluation.predictions import load_results
from doorstate.evaluation.resolution import fewest_points, score_resolution
from doorstate.evaluation.results import Results
from doorstate.inference.export import write_weights_graph
from doorstate.networks.card import Guarantee
from doorstate.networks.digest import write_packaged_digests
from doorstate.networks.door_calibration import DoorCalibration
from doorstate.networks.packaged import packaged_networks, packaged_weights
from doorstate.networks.weights import load_weights, save_weights
from doorstate.training.calibration import abstain_threshold, at_temperature
from doorstate.training.comparison import read_comparison
from doorstate.training.guarantee import guaranteed_threshold, one_sample_a_scene
from doorstate.training.run_folder import run_of
from doorstate.types import DECISION_THRESHOLD, STATES

from . import paths
from .cards import Evidence, Training, model_card
from .definition import Definition, read_definitions
from .published import comparison, study

# Weights have as few default points as lose at most this macro F1 on unseen samples, but not fewer than 1024.
FEWEST_POINTS = 1024
LARGEST_LOSS = 0.002
GUARANTEED_SHARE = 0.02  # of wrong answers, where validation has scenes enough to show it
# Without a guarantee: of validation samples with a state; a smaller share leaves few of them (paper/log.md).
WRONG_SHARE = 0.05
SCENE_SEED = 0  # of the sample of each scene that counts
# Of a doorway. More loses doors of simulated frames, less adds false ones (paper/log.md).
MIN_DOOR_PROBABILITY = 0.4
RECIPE_PROTOCOLS = ("paper", "by-pose")


def package_weights(
    experiment: str, prefix: str = "", networks: Sequence[str] = (), out: Path | None = None
) -> list[Path]:
    """Store the trained networks of `runs/EXPERIMENT` as float16, with a model card beside each.

    Args:
        experiment: name of an experiment with published results, unless its protocol is `all`.
        prefix: text before the network's name in the name of the file.
        networks: networks to store; all that are trained if empty.
        out: folder to write; that of the package if not given.

    Returns:
        Paths of the weights files.
    """
    folder = paths.RUNS / experiment
    config = read_comparison(folder)
    stored = []
    for network_name in networks or config["networks"]:
        run = run_of(folder, network_name, 0)
        if not (run.finished and run.weights.is_file()):
            continue
        network, card = load_weights(run.weights)
        if config["protocol"] == "all":
            evidence = recipe_evidence(network_name, card.num_points)
        else:
            evidence = test_evidence(experiment, network_name, card.num_points)
        card = card.model_copy(
            update={
                "temperature": evidence.temperature,
                "abstain_below": evidence.abstain_below,
                "guarantee": evidence.guarantee,
                "default_points": evidence.default_points,
                "errors": evidence.errors,
                "door_calibration": evidence.door_calibration,
            }
        )
        path = (out or paths.PRETRAINED) / f"{prefix}{network_name}.safetensors"
        save_weights(path, network, card, half=True)
        if out is None:
            write_packaged_digests()
        write_weights_graph(path)
        parameters = sum(parameter.numel() for parameter in network.parameters())
        write_text(path.with_suffix(".md"), model_card(path, card, parameters, Training.read(run), evidence))
        stored.append(path)
    if out is None:
        write_packaged_digests()
    return stored


def package_graphs(names: Sequence[str] = ()) -> list[Path]:
    """Write the ONNX graphs of packaged weights, of all if no names are given, and the digests of packaged files."""
    graphs = [write_weights_graph(packaged_weights(name)) for name in names or packaged_networks()]
    return [*graphs, write_packaged_digests()]


def recipe_evidence(network: str, trained_points: int) -> Evidence:
    """Return the evidence for weights of the common recipe that were trained on every sample of `ogurob`."""
    paper, by_pose = (comparison(name) for name in RECIPE_PROTOCOLS)
    calibration = calibrate(paper, network)
    if calibration is None:
        sys.exit(f"results/paper: no validation predictions of {network}")
    return Evidence(
        temperature=round(median(calibration.temperatures), 4),
        abstain_below=0.0,
        default_points=default_points("by-pose", network, trained_points),
        calibration_error=reliability(calibration.true, calibration.scaled).error,
        comparisons=(paper, by_pose),
    )


def test_evidence(experiment: str, network: str, trained_points: int) -> Evidence:
    """Return the evidence for weights that were tested on samples of their own."""
    results = comparison(experiment)
    calibration = calibrate(results, network)
    if calibration is None:
        sys.exit(f"results/{experiment}: no validation predictions of {network}")
    temperature = round(calibration.temperatures[0], 4)
    validated = load_results(paths.RUNS / experiment)  # published data sets have the tested samples only
    doors = door_calibration(validated, network)
    if doors is not None:
        doors = doors.model_copy(update={"min_probability": MIN_DOOR_PROBABILITY})
    threshold, guarantee = choose_threshold(validated, network, temperature, doors)
    tested = results.tested_by(network)
    return Evidence(
        temperature=temperature,
        abstain_below=threshold,
        default_points=default_points(experiment, network, trained_points),
        calibration_error=reliability(calibration.true, calibration.scaled).error,
        comparisons=(results,),
        errors=standard_errors(validated, network),
        door_calibration=doors,
        guarantee=guarantee,
        answers=count_answers(
            tested, calibration.scaled.max(axis=1) >= threshold, likely_a_door(tested, doors)
        ),
    )


def choose_threshold(
    validated: Results, network: str, temperature: float, doors: DoorCalibration | None
) -> tuple[float, Guarantee | None]:
    """Return the probability below which weights abstain, guaranteed if the validation scenes are enough for it.

    Args:
        validated: results with the manifest of the validation samples.
        network: name of the network.
        temperature: of its probabilities.
        doors: probability of a door; a door that is likely none is given no state.
    """
    own = validated.joined
    rows = own[(own["method"] == network) & (own["role"] == "val") & own["state"].isin(STATES)]
    labels, probabilities = labels_and_probabilities(rows)
    scaled = at_temperature(probabilities, temperature)
    scenes = text_values(rows, "scene_id")
    if (scenes != "").all():
        chosen = one_sample_a_scene(scenes.tolist(), SCENE_SEED)
        confidence = np.where(likely_a_door(rows, doors), scaled.max(axis=1), 0.0)
        correct = scaled.argmax(axis=1) == labels
        guaranteed = guaranteed_threshold(confidence[chosen], correct[chosen], GUARANTEED_SHARE)
        if guaranteed is not None:
            return guaranteed
    return abstain_threshold(scaled, labels, WRONG_SHARE), None


def default_points(experiment: str, network: str, trained: int) -> int | None:
    """Return the fewest points that lose nothing, by the published study of an experiment's weights."""
    for definition in studies_of(experiment):
        if definition.command == "resolution":
            scores = score_resolution(study(definition.name))
            return fewest_points(scores, network, FEWEST_POINTS, trained, LARGEST_LOSS)
    return None


def studies_of(experiment: str) -> list[Definition]:
    """Return the published studies of an experiment's weights.

    A study that was published with other weights ends the program.
    """
    studies = []
    for definition in read_definitions():
        if not (definition.is_study and experiment in definition.starts_from):
            continue
        if not (paths.RESULTS / definition.name).is_dir():
            continue
        parts = study(definition.name).parts.values()
        starts = {Path(str((part.config.model_extra or {}).get("start_from"))).name for part in parts}
        if experiment not in starts:
            sys.exit(
                f"results/{definition.name} tests weights of {' and '.join(sorted(starts))}: run it again"
            )
        studies.append(definition)
    return studies


def likely_a_door(rows: pd.DataFrame, doors: DoorCalibration | None) -> NDArray[np.bool_]:
    """Return for each row whether a door is likely; True throughout without the head `door`."""
    if number_values(rows, "p_door").isna().all():
        return np.ones(len(rows), bool)
    if doors is None:
        return (rows["p_door"] >= DECISION_THRESHOLD).to_numpy()
    return (with_finder(rows, doors)["p_door"] >= doors.min_probability).to_numpy()
