# SPDX-License-Identifier: Apache-2.0
"""Commands and public functions without the optional packages: they work, or name the extra in one line."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from doorstate.errors import EXTRAS
from doorstate.io.pcd import write_pcd
from doorstate.simulation.generate import simulate_rows
from doorstate.simulation.presets import PRESETS

OPTIONAL = [
    *(module for modules in EXTRAS.values() for module in modules),
    "fpsample",
    "torch_quickfps",
    "plotly",
]
# Hides the packages as if they were not installed, runs everything in one process, and prints the outcomes.
RUN = """
import contextlib, io, json, sys
from importlib import import_module
from importlib.machinery import PathFinder

hidden, commands, calls = json.loads(sys.argv[1])

class Installed:
    find_distributions = PathFinder.find_distributions

    @staticmethod
    def find_spec(name, path=None, target=None):
        return None if name.partition(".")[0] in hidden else PathFinder.find_spec(name, path, target)

sys.meta_path[:] = [Installed if finder is PathFinder else finder for finder in sys.meta_path]
from doorstate.cli import main
from doorstate.errors import MissingExtraError

def run(arguments):
    out, err, code = io.StringIO(), io.StringIO(), 0
    sys.argv[1:] = arguments
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    return code, err.getvalue()

def hint(call):
    from doorstate import Predictor, create_network, list_networks, read_cloud
    try:
        eval(call)
    except MissingExtraError as error:
        return error.hint

outcomes = [run(arguments) for arguments in commands[:1]]
loaded = sorted(sys.modules)
outcomes += [run(arguments) for arguments in commands[1:]]
print(json.dumps([outcomes, [hint(call) for call in calls], loaded]))
"""
COMMANDS = {
    ("predict", "pcds/closed/cloud.pcd"): None,
    ("predict", "cloud.pcd"): None,
    ("predict", "cloud.pcd", "--rule", "plane_state"): None,
    ("predict", "cloud.npy", "--network", "pointnet2", "--points", "256", "--json"): None,
    ("predict", "cloud.pcd", "--weights", "own.safetensors"): "train",
    ("predict", "--bag", "run.bag", "--topic", "/points"): "bags",
    ("predict", "cloud.pcd", "--plan", "plan.svg"): None,
    ("doors", "add", "cloud.pcd", "--camera-pose", "0 0 0"): None,
    ("doors", "check", "doors.yaml"): None,
    ("view", "cloud.pcd", "--out", "page.html"): None,
    ("info",): None,
    ("info", "--json"): None,
    ("simulate", "--out", "data", "--poses", "3", "--workers", "1", "--keep", "pcd"): None,
    ("prepare", "pcds", "--out", "prepared", "--points", "128", "--workers", "1"): None,
    ("simulate", "--out", "data", "--poses", "3", "--engine", "ray"): "cluster",
    ("train", "--help"): None,
    ("train", "--network", "pointnet", "--data", "data", "--out", "run"): "train",
    ("adapt", "labelled", "--out", "site.safetensors"): "train",
    ("adapt", "--help"): None,
    ("compare", "experiment.toml"): "train",
    ("report", "run"): "train",
    ("resolution", "run", "--out", "study"): "train",
    ("transfer", "run", "--out", "study"): "train",
    ("evaluate", "pcds"): "train",
    ("export",): "onnx",
    ("serve", "--port", "0"): "serve",
    ("view", "--live", "pcds", "--rule", "plane_state", "--no-open", "--mqtt", "mqtt://localhost"): "mqtt",
    ("--help",): None,
}
CALLS = {
    "Predictor.load('pointnet2')": None,
    "Predictor.load('ogurob-dgcnn', num_points=200)": None,
    "Predictor.load('pointnet2', budget_ms=1)": None,
    "Predictor.load(rule='plane_state')": None,
    "Predictor.load('pointnet2')(read_cloud('cloud.pcd')).probabilities['closed']": None,
    "Predictor.load('pointnet2', backend='torch')": "train",
    "Predictor.load('own.safetensors')": "train",
    "list_networks()": None,
    "create_network('pointnet')": "train",
    "create_network('pointnet2', pretrained=True)": "train",
    "import_module('doorstate.training.comparison')": "train",
    "import_module('doorstate.viewer.label_page')": None,
    "import_module('doorstate.evaluation.metrics')": "train",
    "import_module('doorstate.inference.export')": "onnx",
    "import_module('doorstate.serving.app')": "serve",
    "import_module('doorstate.mqtt.publisher')": "mqtt",
}


class Outcomes(NamedTuple):
    """What happened in an install without optional packages."""

    commands: dict[tuple[str, ...], tuple[int, str]]  # exit code and standard error
    hints: dict[str, str | None]  # of the error of a call
    loaded: set[str]  # modules after the first command


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("light")
    _, frames = simulate_rows(PRESETS["ogurob"], seed=3, index=700)
    for frame, state in zip(frames, ("closed", "semi_open", "open"), strict=True):
        path = folder / "pcds" / state / "cloud.pcd"
        path.parent.mkdir(parents=True)
        write_pcd(path, frame.points)
    write_pcd(folder / "cloud.pcd", frames[2].points)
    np.save(folder / "cloud.npy", frames[2].points)
    for name in ("own.safetensors", "run.bag"):
        (folder / name).write_bytes(b"{}")
    (folder / "experiment.toml").write_text('dataset = "data"\n')
    (folder / "run").mkdir()
    return folder


@pytest.fixture(scope="module")
def outcomes(folder: Path) -> Outcomes:
    return run_without(OPTIONAL, list(COMMANDS), list(CALLS), folder)


def run_without(
    hidden: Sequence[str], commands: list[tuple[str, ...]], calls: list[str], folder: Path
) -> Outcomes:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", RUN, json.dumps([hidden, commands, calls])],
        cwd=folder,
        text=True,
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    ran, hints, loaded = json.loads(done.stdout)
    return Outcomes(dict(zip(commands, ran, strict=True)), dict(zip(calls, hints, strict=True)), set(loaded))


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_commands_work_or_name_the_extra(arguments: tuple[str, ...], outcomes: Outcomes) -> None:
    extra, (code, err) = COMMANDS[arguments], outcomes.commands[arguments]
    if extra is None:
        assert code == 0, err
    else:
        assert (code, err.count("\n")) == (1, 1), err
        assert f'pip install "doorstate[{extra}]"' in err


@pytest.mark.parametrize("call", CALLS)
def test_public_functions_work_or_name_the_extra(call: str, outcomes: Outcomes) -> None:
    extra = CALLS[call]
    assert outcomes.hints[call] == (None if extra is None else f'pip install "doorstate[{extra}]"')


@pytest.mark.parametrize(
    ("extra", "module"),
    [("serve", "doorstate.serving.app"), ("bags", "doorstate.io.bags"), ("mqtt", "doorstate.mqtt.publisher")],
)
def test_an_extra_brings_all_that_its_feature_imports(extra: str, module: str, folder: Path) -> None:
    others = [name for name in OPTIONAL if name not in EXTRAS[extra]]
    call = f"import_module({module!r})"
    assert run_without(others, [("info",)], [call], folder).hints == {call: None}


def test_a_network_answers_without_what_only_rules_need(outcomes: Outcomes) -> None:
    assert "onnxruntime" in outcomes.loaded
    assert not {"scipy", "doorstate.doorways.planes", "doorstate.simulation"} & outcomes.loaded
