# SPDX-License-Identifier: Apache-2.0
"""Exported network behind a `Predictor`, with torch and without."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from doorstate.clouds.preparation import MIN_POINTS
from doorstate.dataset.store import PreparedDataset
from doorstate.errors import ConfigError, WeightsError
from doorstate.inference.abstention import AbstentionCode
from doorstate.inference.backends.onnx_backend import REASONS, OnnxBackend
from doorstate.inference.backends.threads import default_threads
from doorstate.inference.decode import decode
from doorstate.inference.network_predictor import NetworkPredictor
from doorstate.inference.predictor import Predictor
from doorstate.networks import create_network
from doorstate.networks.card import CARD_KEY, WeightsCard
from doorstate.networks.weights import save_weights
from doorstate.simulation.frames import replay
from doorstate.simulation.manifest import unflatten
from doorstate.types import DoorState, Points
from tests.attack.numbers import write_graph

Run = Callable[..., tuple[int, str, str]]
DOCS = Path(__file__).resolve().parents[2] / "docs" / "onnx.md"
BLOCKED = "import sys; sys.modules.update(torch=None, onnx=None, onnxscript=None); "


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("onnx") / "pointnet.safetensors"
    card = WeightsCard(network="pointnet", num_points=160, temperature=0.01)
    save_weights(path, create_network("pointnet"), card)
    return path


@pytest.fixture(scope="module")
def exported(weights: Path) -> Path:
    """Made by the command in a process of its own, as users make it."""
    path = weights.with_suffix(".onnx")
    arguments = ["export", "--weights", weights, "--out", path, "--clouds", "3"]
    call = [sys.executable, "-c", "from doorstate.cli import main; main()", *map(str, arguments)]
    done = subprocess.run(call, text=True, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert all(line.endswith(" left") for line in done.stderr.splitlines()), (
        "progress of a busy machine, no warning"
    )
    assert str(path) in done.stdout
    return path


@pytest.fixture(scope="module")
def raw(small_dataset: PreparedDataset) -> list[Points]:
    return [replay(unflatten(row)).points for row in small_dataset.rows[:3]]


def run_without_torch(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", BLOCKED + script], cwd=folder, text=True, capture_output=True
    )


def test_it_predicts_as_the_weights_do(exported: Path, weights: Path, raw: list[Points]) -> None:
    half = raw[0].copy()
    half[:, :320] = np.nan
    clouds = [*raw, half, raw[1].reshape(-1, 3)]
    file, torch = Predictor.load(exported), Predictor.load(weights)
    file.warm_up()
    for one, other in zip(file.batch(clouds), torch.batch(clouds), strict=True):
        assert (one.state, one.num_points, one.reason) == (other.state, other.num_points, other.reason)
        assert one.probabilities == pytest.approx(other.probabilities, abs=1e-4)
    assert file(half).state is None
    assert Predictor.load(exported, gate=None)(half).state is not None


def test_the_number_of_points_is_fixed(exported: Path) -> None:
    assert (
        NetworkPredictor.from_weights(exported).num_points
        == NetworkPredictor.from_weights(exported, num_points=160).num_points
        == 160
    )
    assert NetworkPredictor.from_weights(exported, budget_ms=0.001).num_points == 160, (
        "there is nothing to choose"
    )
    with pytest.raises(ConfigError, match="160"):
        NetworkPredictor.from_weights(exported, num_points=256)
    few = np.random.default_rng(0).uniform(1, 3, (140, 3)).astype(np.float32)
    prediction = Predictor.load(exported, gate=None)(few)
    assert prediction.state is None
    assert prediction.abstention is not None
    assert prediction.abstention.code == "too_few_points"


def test_threads_are_an_argument_or_set_by_the_environment(
    exported: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def options(backend: OnnxBackend) -> tuple[int, str]:
        used = backend._session.get_session_options()
        return int(used.intra_op_num_threads), used.get_session_config_entry(
            "session.intra_op.allow_spinning"
        )

    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert options(OnnxBackend(exported)) == (3, "0")
    assert options(OnnxBackend(exported, threads=2)) == (2, "0")
    monkeypatch.delenv("OMP_NUM_THREADS")
    assert options(OnnxBackend(exported, spinning=True)) == (default_threads(), "1")


def test_unusable_files_are_weights_errors(tmp_path: Path, exported: Path) -> None:
    def error_of(path: Path) -> WeightsError:
        with pytest.raises(WeightsError) as caught:
            Predictor.load(path)
        assert "\n" not in str(caught.value)
        return caught.value

    path = tmp_path / "door.onnx"
    assert error_of(path).path == path
    model = onnx.load(exported)
    del model.metadata_props[:]  # a changed file differs from the digest in its card
    model.ir_version = 9999
    onnx.save(model, path)
    with pytest.raises(WeightsError, match="too new for onnxruntime") as caught:
        OnnxBackend(path)
    assert caught.value.hint is not None
    for damaged in (b"", b"garbage", exported.read_bytes()[:5000]):
        path.write_bytes(damaged)
        assert error_of(path).path == path
    value = helper.make_tensor_value_info("x", TensorProto.FLOAT, [1])
    same = helper.make_tensor_value_info("y", TensorProto.FLOAT, [1])
    graph = helper.make_graph([helper.make_node("Identity", ["x"], ["y"])], "foreign", [value], [same])
    onnx.save(helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 18)]), path)
    assert error_of(path).field == "doorstate"


def test_a_card_with_an_unknown_head_is_refused(tmp_path: Path, exported: Path) -> None:
    path = tmp_path / "door.onnx"
    model = onnx.load(exported)
    card = WeightsCard(network="pointnet", num_points=160, heads=("angel",))
    helper.set_model_props(model, {CARD_KEY: card.model_dump_json()})
    onnx.save(model, path)
    with pytest.raises(WeightsError) as caught:
        OnnxBackend(path)
    assert (caught.value.path, caught.value.field) == (path, "heads")


@pytest.mark.parametrize("reason", REASONS)
def test_a_broken_head_is_no_withheld_one(tmp_path: Path, reason: AbstentionCode | None) -> None:
    path = tmp_path / "door.onnx"
    write_graph(path, (0.1, 0.1, 0.8), math.nan, reason)
    (outputs,) = OnnxBackend(path)(np.ones((1, MIN_POINTS, 3), np.float32)).per_cloud()
    assert not outputs.are_valid()
    write_graph(path, (0.1, 0.1, 0.8), 0.9, None)
    (outputs,) = OnnxBackend(path)(np.ones((1, MIN_POINTS, 3), np.float32)).per_cloud()
    assert outputs.are_valid()
    assert decode(outputs, 0.0, MIN_POINTS, 0.0).state == DoorState.OPEN


def test_export_rejects_options_that_do_not_fit(run: Run, weights: Path) -> None:
    for arguments in (
        ("--network", "dgcnn", "--weights", weights),
        ("--network", "mvcnn"),
        ("--out", "x.pb"),
    ):
        code, _, err = run("export", *arguments)
        assert code != 0
        assert err.count("\n") == 1


def test_the_documented_python_runs_without_torch(
    exported: Path, simulated_folder: Path, tmp_path: Path
) -> None:
    example, of_doorways = re.findall(
        r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    shutil.copy(exported, tmp_path / "pointnet2.onnx")
    shutil.copy(sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0], tmp_path / "cloud.pcd")
    assert run_without_torch(of_doorways, tmp_path).returncode == 0
    done = run_without_torch(example, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.match(r"\w+ \{'closed': ", done.stdout)


def test_predict_runs_without_torch(
    exported: Path, weights: Path, simulated_folder: Path, tmp_path: Path
) -> None:
    cloud = sorted((simulated_folder / "pcd" / "open").glob("*.pcd"))[0]

    def predict(file: Path) -> subprocess.CompletedProcess[str]:
        arguments = ["doorstate", "predict", str(cloud), "--weights", str(file), "--json"]
        return run_without_torch(
            f"from doorstate.cli import main; sys.argv[:] = {arguments}; main()", tmp_path
        )

    done = predict(exported)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["points"] == 160
    done = predict(weights)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "doorstate[train]" in done.stderr
